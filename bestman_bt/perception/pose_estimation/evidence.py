"""The evidence for a pose hypothesis, and the confidence computed from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.perception.pose_estimation.model_surface import ModelSurface
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class PoseEvidence:
    """Features of the confidence model, as in PoseHypothesis; ``rmse`` includes only the points on the model.

    ``outside``: fraction of the model's camera-side surface that lies beyond the image's border. ``noise``: the depth
    noise expected at that distance, metres.
    """

    rmse: float
    explained: float
    visible_fraction: float
    floating: float
    outside: float
    noise: float


@dataclass(frozen=True)
class ConfidenceModel:
    """Logistic regression on the evidence, fitted on rendered scenes (see docs/perception.md).

    ``bias``: log-odds of a perfect fit; the others are weights. ``unexplained``: of the fraction of points that are not
    on the model. ``floating``: of the fraction of its surface through which the camera sees. ``hidden``: of the
    fraction of it that is not visible. ``rmse_ratio``: of the rms of the residuals beyond the noise, in multiples of
    the noise. ``color``: of the colour distance. ``outside``: of the fraction beyond the image's border, set by hand.
    """

    bias: float = 5.5
    unexplained: float = -160.0
    floating: float = -50.0
    hidden: float = -3.0
    outside: float = -5.0
    rmse_ratio: float = -3.0
    color: float = -30.0

    def logit(self, evidence: PoseEvidence, color: float) -> float:
        """Return the log-odds log(p / (1 - p)) that model and pose are correct."""
        ratio = max(0.0, evidence.rmse / evidence.noise - 1.0)
        return (
            self.bias
            + self.unexplained * (1.0 - evidence.explained)
            + self.floating * evidence.floating
            + self.hidden * (1.0 - evidence.visible_fraction)
            + self.outside * evidence.outside
            + self.rmse_ratio * ratio
            + self.color * color
        )


def judge(
    surface: ModelSurface,
    frame_from_object: Pose,
    residuals: NDArray[np.float64],
    cluster: Cluster,
    view: View,
    noise: float,
) -> PoseEvidence:
    """Compare a placed model with the cluster (``residuals``: distance of each point) and with the depth image."""
    on_model = np.abs(residuals) < max(0.006, 3 * noise)
    rmse = float(np.sqrt(np.mean(residuals[on_model] ** 2))) if on_model.any() else 1.0
    frame_from_rest = frame_from_object @ surface.rest_from_object.inverse()
    points = frame_from_rest.apply(surface.points)
    normals = surface.normals @ frame_from_rest.rotation.T
    towards = view.viewpoint - points
    facing = (towards * normals).sum(axis=1) > 0.15 * np.linalg.norm(towards, axis=1)
    above = cluster.plane.heights(points) > 0.01
    points = points[facing & above]
    pixels, depth = view.project(points)
    seen = _unobstructed(pixels, depth)
    pixels, depth = pixels[seen], depth[seen]
    size = np.array([view.image.intrinsics.width, view.image.intrinsics.height])
    inside = np.asarray(((pixels > -0.5) & (pixels < size - 0.5)).all(axis=1))
    measured = view.measured_depth(pixels)
    known = np.isfinite(measured)
    tolerance = max(0.008, 4 * noise)
    difference = measured[known] - depth[known]
    count = max(1, int(known.sum()))
    return PoseEvidence(
        rmse=rmse,
        explained=float(on_model.mean()),
        visible_fraction=float((np.abs(difference) <= tolerance).sum() / count),
        floating=float((difference > tolerance).sum() / count),
        outside=1.0 - float(inside.sum() / max(1, len(inside))),
        noise=noise,
    )


def color_distance(colors: NDArray[np.uint8], model_color: tuple[float, float, float]) -> float:
    """Return the distance of chromaticities (rgb divided by its sum), which are invariant to shading, 0 to about 1.

    ``colors``: (N, 3). Adds 0.1 per factor e of brightness difference beyond a factor of 2.
    """
    seen = np.median(colors.astype(np.float64), axis=0) / 255.0 + 0.02
    wanted = np.array(model_color) + 0.02
    chromaticity = float(np.linalg.norm(seen / seen.sum() - wanted / wanted.sum()))
    brightness = abs(math.log(seen.sum() / wanted.sum()))
    return chromaticity + 0.1 * max(0.0, brightness - math.log(2.0))


def _unobstructed(pixels: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return the samples that no other sample of the same model hides: a depth buffer with cells of 3 pixels."""
    if len(pixels) == 0:
        return np.zeros(0, dtype=bool)
    cells = np.floor((pixels - pixels.min(axis=0)) / 3.0).astype(np.intp)
    nearest = np.full(cells.max(axis=0) + 1, np.inf)
    np.minimum.at(nearest, (cells[:, 0], cells[:, 1]), depth)
    visible: NDArray[np.bool_] = depth < nearest[cells[:, 0], cells[:, 1]] + 0.010
    return visible
