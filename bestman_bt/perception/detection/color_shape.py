"""Detection by colour and shape: a fast comparison first, registration only of plausible models.

Each cluster is compared with the expected appearance of every model from the camera (see color_palette and
shape_signature). Only the likeliest models are passed to the pose estimator, so many models cost little. A model that
the estimator does not confirm gives no name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import ObjectModel, Pose
from bestman_bt.perception.detection.base import DetectedScene, Detector, Naming
from bestman_bt.perception.errors import PerceptionError
from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.model_surface import sample_shape
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.segmentation.base import Cluster, Region, Segmentation
from bestman_bt.perception.segmentation.region_growing import RegionGrowing
from bestman_bt.perception.view import View

# What one view shows of a thing's shape, in a few numbers: extents, how they change with height, flatness, bulge.
# The same numbers are taken of a cluster and of the part of a model's surface that faces the camera, at every yaw, so
# that a model is compared with what it would look like from there.


SCALES = np.array([0.006, 0.008, 0.008, 0.008, 0.012, 0.15, 0.005])
"""Typical difference of each entry of a signature between two views of the same object."""

_THIRDS = (0.0, 1 / 3, 2 / 3, 1.0)


def signature(points: NDArray[np.float64], eye: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shape signature (7,) of a cluster: height; width of the lower, middle and upper third; depth (metres);
    fraction of points at the top; bulge.

    ``points``: (N, 3) metres, z above the support surface. ``eye``: (3,) position of the camera. Width is measured
    across the viewing direction, depth along it. Bulge: metres by which the middle of the sides protrudes beyond their
    ends.
    """
    top = _quantile(points[:, 2], 0.98)
    centre = points[:, :2].mean(axis=0)
    away = centre - eye[:2]
    away = away / max(float(np.linalg.norm(away)), 1e-9)
    along = (points[:, :2] - centre) @ away
    across = (points[:, :2] - centre) @ np.array([-away[1], away[0]])
    level = points[:, 2] / max(top, 1e-3)
    widths = [_extent(across[(level >= low) & (level <= high)]) for low, high in pairwise(_THIRDS)]
    at_top = points[:, 2] > top - 0.008
    side = ~at_top
    bulge = 0.0
    half = _extent(across[side]) / 2
    if side.sum() >= 12 and half > 0.004:
        t = (across[side] - across[side].mean()) / half
        columns = np.stack([np.ones(len(t)), t, t * t], axis=1)
        # Normal equations by sums: BLAS adds in another order with another number of threads.
        normal = (columns[:, :, None] * columns[:, None, :]).sum(axis=0) + 1e-9 * np.eye(3)
        bulge = float(np.linalg.solve(normal, (columns * along[side, None]).sum(axis=0))[2])
    return np.array([top, *widths, _extent(along), float(at_top.mean()), float(np.clip(bulge, -0.03, 0.03))])


@dataclass(frozen=True, eq=False)
class ModelAppearance:
    """The appearance of a model from one elevation, at Y yaws.

    ``signatures``: (Y, 7). ``palette``: (K, 3) rgb and ``shares``: (Y, K) of these colours, as in palette_distance.
    """

    signatures: NDArray[np.float64]
    palette: NDArray[np.float64]
    shares: NDArray[np.float64]

    def shape_distance(self, seen: NDArray[np.float64]) -> float:
        """Return the distance of a cluster's signature at the best yaw: the mean difference in units of SCALES."""
        difference = (seen - self.signatures) / SCALES
        # Something nearer may hide a part, so less than expected counts half.
        extents = difference[:, 1:5]
        difference[:, 1:5] = np.where(extents < 0, 0.5 * extents, extents)
        return float(np.minimum(np.abs(difference), 4.0).mean(axis=1).min())


def model_appearance(model: ObjectModel, elevation: float, yaws: int = 24, spacing: float = 0.005) -> ModelAppearance:
    """Return the appearance of ``model`` from ``elevation`` radians above the horizon, at a distance of one metre.

    Raises PerceptionError if the model has no shapes.
    """
    parts = model.visual or model.collision
    if not parts:
        raise PerceptionError(f"model {model.name!r} has no shapes: give it visual or collision shapes")
    colors = model.visual_colors if model.visual and model.visual_colors else (model.color,) * len(parts)
    palette, color_of_part = np.unique(np.array(colors, dtype=float), axis=0, return_inverse=True)
    samples = [sample_shape(part.shape, spacing) for part in parts]
    points = np.concatenate([part.pose.apply(found[0]) for part, found in zip(parts, samples, strict=True)])
    normals = np.concatenate([found[1] @ part.pose.rotation.T for part, found in zip(parts, samples, strict=True)])
    color = np.repeat(color_of_part.reshape(-1), [len(found[0]) for found in samples])
    points = points - [0.0, 0.0, float(points[:, 2].min())]
    span = 2 * math.pi / model.symmetry_order if model.symmetry_order else 0.0
    count = max(1, round(yaws * span / (2 * math.pi))) if span else 1
    eye = np.array([-math.cos(elevation), 0.0, math.sin(elevation) + float(points[:, 2].max()) / 2])
    found_signatures, shares = [], []
    for yaw in np.arange(count) * (span / count):
        turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, float(yaw)))
        turned = turn.apply(points)
        visible = _visible(turned, normals @ turn.rotation.T, eye, 2 * spacing) & (turned[:, 2] > 0.008)
        if visible.sum() >= 8:
            found_signatures.append(signature(turned[visible], eye))
            shares.append(np.bincount(color[visible], minlength=len(palette)) / visible.sum())
    if not found_signatures:
        raise PerceptionError(f"model {model.name!r} is too small to be seen: {model.size} m")
    return ModelAppearance(np.array(found_signatures), palette, np.array(shares))


def _visible(
    points: NDArray[np.float64], normals: NDArray[np.float64], eye: NDArray[np.float64], cell: float
) -> NDArray[np.bool_]:
    """Return the samples that face the camera and that no other sample hides: a depth buffer with
    cells of that size.
    """
    towards = eye - points
    distance = np.linalg.norm(towards, axis=1)
    facing = (towards * normals).sum(axis=1) > 0.1 * distance
    middle = points.mean(axis=0) - eye
    forward = middle / np.linalg.norm(middle)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    image = np.stack([-towards @ right, -towards @ np.cross(right, forward)], axis=1)
    cells = np.floor((image - image.min(axis=0)) / cell).astype(np.intp)
    nearest = np.full(cells.max(axis=0) + 1, np.inf)
    np.minimum.at(nearest, (cells[:, 0], cells[:, 1]), distance)
    visible: NDArray[np.bool_] = facing & (distance < nearest[cells[:, 0], cells[:, 1]] + 0.012)
    return visible


def _extent(values: NDArray[np.float64]) -> float:
    if len(values) < 4:
        return 0.0
    return _quantile(values, 0.98) - _quantile(values, 0.02)


def _quantile(values: NDArray[np.float64], share: float) -> float:
    """Return the value at that rank: several times faster than the interpolating ``np.quantile``."""
    rank = min(len(values) - 1, int(share * len(values)))
    return float(np.partition(values, rank)[rank])


# Colours of models and clusters: chromaticity histograms over a model's few colours.
# Swain and Ballard, "Color Indexing", 1991, with the model's own colours as bins. Chromaticity (rgb divided by its sum)
# does not change with shading; brightness tells white from black, but weighs little.


_DARK = 0.02
"""Added to each channel, because the chromaticity of black is noise."""


def palette_distance(colors: NDArray[np.uint8], palette: NDArray[np.float64], shares: NDArray[np.float64]) -> float:
    """Return the distance between the colours (N, 3) of a cluster and those of a model, 0 to about 1.

    ``palette``: (K, 3) rgb, each 0 to 1. ``shares``: (Y, K) fraction of the model's visible surface in each colour, at
    each yaw. The distance is the mean distance of the points to the nearest colour of the palette, plus 0.3 times the
    deviation of the colour fractions beyond 0.08 at the best yaw; closer objects may hide a part.
    """
    seen = colors[np.linspace(0, len(colors) - 1, min(len(colors), 400)).astype(np.intp)].astype(np.float64) / 255.0
    distance = np.linalg.norm(_chromaticity(seen)[:, None] - _chromaticity(palette)[None], axis=2)
    brightness = np.log((seen.sum(axis=1) + 3 * _DARK)[:, None] / (palette.sum(axis=1) + 3 * _DARK)[None])
    distance = distance + 0.1 * np.maximum(0.0, np.abs(brightness) - np.log(2.0)) + 0.01 * np.abs(brightness)
    nearest = distance.argmin(axis=1)
    found = np.bincount(nearest, minlength=len(palette)) / len(seen)
    mixed_up = float(np.abs(found - shares).sum(axis=1).min()) / 2
    return float(np.minimum(distance.min(axis=1), 0.4).mean()) + 0.3 * max(0.0, mixed_up - 0.08)


def _chromaticity(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    lit = rgb + _DARK
    chromaticity: NDArray[np.float64] = lit / lit.sum(axis=-1, keepdims=True)
    return chromaticity


@dataclass(frozen=True)
class ColorShape(Naming, Detector):
    """Compares colour and shape first, and registers only models that match the cluster.

    ``max_color``, ``max_shape``: colour (``palette_distance``) and shape distances (``ModelAppearance``) above which a
    model is not tried. ``color_weight``: weight of colour against shape in the order of the tries. ``first``: number of
    models tried first if within ``margin`` of the most probable; the others, up to ``most``, are tried one by one until
    one is confirmed. ``tie``: two confirmed models whose logits of confidence differ by less are distinguished by
    colour and shape. ``elevation_step``: radians; appearances of models are cached in such steps.
    """

    segmentation: Segmentation = field(default_factory=RegionGrowing)
    pose_estimator: PoseEstimator = field(default_factory=MultiStart)
    max_color: float = 0.15
    max_shape: float = 3.0
    color_weight: float = 15.0
    first: int = 2
    margin: float = 0.6
    most: int = 4
    tie: float = 1.5
    elevation_step: Annotated[float, "rad"] = math.radians(10.0)
    _looks: dict[tuple[ObjectModel, int], ModelAppearance] = field(default_factory=dict, init=False, repr=False)

    @override
    def detect(
        self, view: View, region: Region, models: Sequence[ObjectModel], rng: np.random.Generator
    ) -> DetectedScene:
        scene = self.segmentation.segment(view, region, rng)
        found = [(cluster, self._hypotheses(cluster, models, view)) for cluster in scene.clusters]
        return self.named_scene(scene, found)

    def candidates(
        self, cluster: Cluster, models: Sequence[ObjectModel], view: View
    ) -> tuple[tuple[ObjectModel, float], ...]:
        """Return the models that may explain ``cluster``, likeliest first, each with its distance in colour and
        shape.
        """
        plane_from_frame = cluster.plane.frame_from_plane.inverse()
        points, eye = plane_from_frame.apply(cluster.points), plane_from_frame.apply(view.viewpoint)
        towards = eye - points.mean(axis=0)
        elevation = math.atan2(towards[2], math.hypot(towards[0], towards[1]))
        seen = signature(points, eye)
        found = []
        for model in models:
            look = self._look(model, round(elevation / self.elevation_step))
            color = palette_distance(cluster.colors, look.palette, look.shares)
            if color > self.max_color:
                continue
            shape = look.shape_distance(seen)
            if shape <= self.max_shape:
                found.append((model, shape + self.color_weight * color))
        found.sort(key=lambda item: item[1])
        return tuple(found)

    def _hypotheses(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        likely = self.candidates(cluster, models, view)[: self.most]
        distance = {model.name: value for model, value in likely}
        found: list[PoseHypothesis] = []
        close = [item for item in likely[: self.first] if item[1] <= likely[0][1] + self.margin]
        for some in (close, *([item] for item in likely[len(close) :])):
            found += self.pose_estimator.estimate(cluster, [model for model, _ in some], view)
            if any(hypothesis.confidence >= self.min_confidence for hypothesis in found):
                break
        found.sort(key=lambda hypothesis: -hypothesis.confidence)
        if len(found) > 1:
            level = _logit(found[0].confidence) - self.tie
            tied = [hypothesis for hypothesis in found if _logit(hypothesis.confidence) >= level]
            tied.sort(key=lambda hypothesis: distance[hypothesis.model.name])
            found = tied + [hypothesis for hypothesis in found if hypothesis not in tied]
        return tuple(found)

    def _look(self, model: ObjectModel, step: int) -> ModelAppearance:
        if (model, step) not in self._looks:
            self._looks[model, step] = model_appearance(model, step * self.elevation_step)
        return self._looks[model, step]


def _logit(confidence: float) -> float:
    bounded = min(max(confidence, 1e-9), 1.0 - 1e-9)
    return math.log(bounded / (1.0 - bounded))
