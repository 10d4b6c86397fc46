"""Registration of known models to a cluster from many starts, judged against the whole image.

All starts are fitted in parallel; the best ones are refined on the part of the surface that faces the camera, and
evaluated: whether the model explains the points, whether a part of it would float in front of measured depth, and
whether the colour matches. For a model without symmetry the likelihood of every yaw is computed; the result contains
the plausible ones.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import expit
from typing_extensions import override

from bestman_bt.messages import Box, ObjectModel, Pose, YawSet
from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.evidence import ConfidenceModel, PoseEvidence, color_distance, judge
from bestman_bt.perception.pose_estimation.model_surface import (
    ModelSurface,
    color_distances,
    model_palette,
    model_surface,
)
from bestman_bt.perception.pose_estimation.point_to_plane import YawObservability, yaw_observability
from bestman_bt.perception.pose_estimation.registration import Fit, Registration, end_aligned_poses, yaw_difference
from bestman_bt.perception.pose_estimation.yaw_profile import YawSearch
from bestman_bt.perception.segmentation.base import Cluster, voxel_means
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class UnassignedPoints:
    """Finds points near a cluster that belong to the same object.

    Lengths in metres.

    ``reach``: search distance around the cluster's box; ``link``: maximum distance of a point from the next, or from
    the cluster. ``color``: maximum chromaticity distance to the nearest colour of the model. ``voxel``: size of the
    voxel filter. ``min_height``: above the plane.
    """

    reach: Annotated[float, "m"] = 0.07
    link: Annotated[float, "m"] = 0.015
    color: float = 0.10
    voxel: Annotated[float, "m"] = 0.004
    min_height: Annotated[float, "m"] = 0.010

    def added_to(
        self, points: NDArray[np.float64], plane_view: View, palette: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return ``points`` (N, 3) of a cluster with nearby points that have the model's colours and are linked to it.

        All in the plane's frame. ``palette``: (K, 3), the model's colours.
        """
        grow = np.array([self.reach, self.reach, self.link])
        lower, upper = points.min(axis=0) - grow, points.max(axis=0) + grow
        lower[2] = self.min_height
        corners = np.array(
            [[x, y, z] for x in (lower[0], upper[0]) for y in (lower[1], upper[1]) for z in (0.0, upper[2])]
        )
        cloud = plane_view.cloud(corners)
        cloud = cloud.selected(((cloud.points > lower) & (cloud.points < upper)).all(axis=1))
        assert cloud.colors is not None
        cloud = cloud.selected(color_distances(cloud.colors, palette) < self.color)
        known = cKDTree(points)
        if len(cloud):
            cloud = voxel_means(cloud.selected(known.query(cloud.points)[0] > self.voxel), self.voxel)
        if len(cloud) == 0:
            return points
        pairs = cKDTree(cloud.points).query_pairs(self.link, output_type="ndarray")
        count = len(cloud)
        _, group = connected_components(
            coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count)), directed=False
        )
        linked = np.isin(group, group[known.query(cloud.points)[0] <= self.link])
        return np.concatenate([points, cloud.points[linked]])


PLANE_HEIGHT_STD, PLANE_TILT_STD = 0.0003, 0.001
"""Metres and radians: three times the values from rendered images, whose noise is independent between pixels."""


@dataclass(frozen=True)
class MultiStart(Registration, PoseEstimator):
    """Registers known models to a cluster from many starts and rates each fit on the whole image.

    Lengths in metres, angles in radians.

    ``size_tolerance``: a model is not tried if its height or extent differs by more, or if its colour distance exceeds
    ``color_limit``. ``tipped``: whether to also try objects that lie on their side. ``yaw_margin``: how much lower the
    logit of confidence may be at an ambiguous yaw, for models with a symmetry; those without use ``yaw`` and
    ``strays``. ``floating_retry``, ``explained_retry``: if more than this fraction of the best fit floats, but more
    than that fraction of the points are on it, the model is also tried with its ends at the cluster's ends, along axes
    in which it is longer by ``hidden_length``.
    """

    size_tolerance: Annotated[float, "m"] = 0.022
    color_limit: float = 0.15
    tipped: bool = False
    yaw_margin: float = 3.0
    floating_retry: float = 0.05
    explained_retry: float = 0.95
    hidden_length: Annotated[float, "m"] = 0.008
    confidence: ConfidenceModel = field(default_factory=ConfidenceModel)
    yaw: YawSearch = field(default_factory=YawSearch)
    strays: UnassignedPoints = field(default_factory=UnassignedPoints)

    @cached_property
    def surfaces(self) -> SurfaceStore:
        """The cache of sampled surfaces of models."""
        return SurfaceStore(self.spacing, self.tipped)

    @override
    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        seen = SeenCluster.of(cluster, view, self)
        found = [best for model in models if (best := self._fit_model(model, seen)) is not None]
        found.sort(key=lambda hypothesis: -hypothesis.confidence)
        return tuple(found)

    def _fit_model(self, model: ObjectModel, seen: SeenCluster) -> PoseHypothesis | None:
        color = color_distance(seen.cluster.colors, model.color)
        if color > self.color_limit:
            return None
        best: _Candidate | None = None
        for index, surface in enumerate(self.surfaces.resting(model)):
            if not seen.may_be(surface, self.size_tolerance):
                continue
            turns = model.symmetry_order if index == 0 else 2
            if turns == 1:
                candidate = self._fit_at_all_yaws(model, surface, seen, color)
            else:
                candidate = self._fit_some_starts(surface, seen, turns, color)
            if best is None or candidate.logit > best.logit:
                best = candidate
        if best is None:
            return None
        upright = best.surface is self.surfaces.resting(model)[0]
        pose = best.fit.frame_from_object(seen.cluster.plane.frame_from_plane, best.surface)
        # Yaws of fits are in the plane's frame, those of the result in the view's.
        turn = pose.yaw - float(best.fit.pose[2])
        return PoseHypothesis(
            model=model,
            pose=pose,
            confidence=float(expit(best.logit)),
            covariance=covariance_in_frame(best.fit.covariance, seen.cluster.plane.frame_from_plane),
            yaw_set=best.yaws.turned(turn) if model.symmetry_order else YawSet(),
            rmse=best.evidence.rmse,
            explained=best.evidence.explained,
            visible_fraction=best.evidence.visible_fraction,
            floating=best.evidence.floating,
            color_distance=color,
            upright=upright,
        )

    def _fit_some_starts(self, surface: ModelSurface, seen: SeenCluster, turns: int, color: float) -> _Candidate:

        def judged(start: NDArray[np.float64]) -> tuple[float, Fit, PoseEvidence]:
            fit = self.refined_fit(surface, seen.points, seen.eye, start, turns)
            evidence = seen.judge(surface, fit)
            return self.confidence.logit(evidence, color), fit, evidence

        starts = self.coarse_poses(surface, seen.points, seen.eye, turns, self.refined)
        fits = sorted((judged(start) for start in starts), key=lambda item: -item[0])
        if turns and fits[0][2].floating > self.floating_retry and fits[0][2].explained > self.explained_retry:
            shifted = end_aligned_poses(surface, seen.points, fits[0][1].pose, self.hidden_length)
            fits = sorted([*fits, *map(judged, shifted)], key=lambda item: -item[0])
        logit, best, evidence = fits[0]
        others = [
            fit
            for other_logit, fit, _ in fits[1:]
            if logit - other_logit < self.yaw_margin
            and yaw_difference(float(best.pose[2] - fit.pose[2]), turns) > self.yaw_separation
        ]
        arcs = tuple((float(fit.pose[2]), 3.0 * fit.yaw_std) for fit in (best, *others))
        return _Candidate(logit, surface, best, evidence, YawSet(arcs))

    def _fit_at_all_yaws(
        self, model: ObjectModel, surface: ModelSurface, seen: SeenCluster, color: float
    ) -> _Candidate:
        turned = self.surfaces.turned(surface)
        palette = model_palette(model)
        points = self.strays.added_to(seen.points, seen.plane_view, palette)
        start = self.coarse_poses(surface, seen.points, seen.eye, 1, 1)[0]
        profile = self.yaw.profile(turned, points, seen.plane_view, start, palette, seen.noise)
        starts = profile.starts(self.yaw.margin, self.refined)
        fits = [self.refined_fit(surface, points, seen.eye, start, 1) for start in starts]
        poses = np.array([fit.pose for fit in fits])
        likelihood = self.yaw.likelihood(turned, points, seen.plane_view, poses, palette, seen.noise)
        best = fits[int(likelihood.argmax())]
        evidence = seen.judge(surface, best)
        yaws = profile.plausible_yaws(self.yaw.margin, float(best.pose[2]), best.yaw_std)
        return _Candidate(self.confidence.logit(evidence, color), surface, best, evidence, yaws)


@dataclass(frozen=True, eq=False)
class _Candidate:
    """``yaws``: in the plane's frame."""

    logit: float
    surface: ModelSurface
    fit: Fit
    evidence: PoseEvidence
    yaws: YawSet


@dataclass(frozen=True, eq=False)
class SeenCluster:
    """A cluster in its plane's frame: ``points`` (N, 3), ``eye`` (3,), ``plane_view``; ``noise``: of depth, metres."""

    cluster: Cluster
    view: View
    plane_view: View
    points: NDArray[np.float64]
    eye: NDArray[np.float64]
    noise: float

    @classmethod
    def of(cls, cluster: Cluster, view: View, registration: Registration) -> SeenCluster:
        """Move cluster and view into the frame of the cluster's plane."""
        plane_from_frame = cluster.plane.frame_from_plane.inverse()
        points, plane_view = plane_from_frame.apply(cluster.points), view.seen_from(plane_from_frame)
        noise = registration.depth_noise(points, plane_view.viewpoint)
        return cls(cluster, view, plane_view, points, plane_view.viewpoint, noise)

    def may_be(self, surface: ModelSurface, tolerance: float) -> bool:
        """Return whether height and extent fit; at the image border, the object may extend beyond the visible part."""
        box = self.cluster.bounding_box.shape
        assert isinstance(box, Box)
        top = float(np.percentile(self.points[:, 2], 98.0))
        missing = surface.height - top
        high_enough = missing <= tolerance or self.cluster.at_border
        return missing >= -tolerance and high_enough and math.hypot(*box.size[:2]) <= surface.reach + tolerance

    def judge(self, surface: ModelSurface, fit: Fit) -> PoseEvidence:
        """Compare the fit, whose first residuals are the cluster's, with points and image."""
        frame_from_object = fit.frame_from_object(self.cluster.plane.frame_from_plane, surface)
        return judge(surface, frame_from_object, fit.residuals[: len(self.points)], self.cluster, self.view, self.noise)


class SurfaceStore:
    """A cache of sampled surfaces of models, computed on first use."""

    def __init__(self, spacing: float, tipped: bool) -> None:
        self._spacing = spacing
        self._tipped = tipped
        self._resting: dict[ObjectModel, tuple[ModelSurface, ...]] = {}
        self._turned: dict[ModelSurface, YawObservability] = {}

    def resting(self, model: ObjectModel) -> tuple[ModelSurface, ...]:
        """Return the model standing upright and, if configured, lying on its sides."""
        if model not in self._resting:
            quarter = math.pi / 2
            orientations = [Pose()]
            if self._tipped:
                orientations.append(Pose.from_xyz_rpy((0, 0, 0), (quarter, 0, 0)))
                if model.symmetry_order not in (0, 4):
                    orientations.append(Pose.from_xyz_rpy((0, 0, 0), (0, quarter, 0)))
            self._resting[model] = tuple(model_surface(model, pose, self._spacing) for pose in orientations)
        return self._resting[model]

    def turned(self, surface: ModelSurface) -> YawObservability:
        """Return the surface compared with itself, turned."""
        if surface not in self._turned:
            self._turned[surface] = yaw_observability(surface)
        return self._turned[surface]


def covariance_in_frame(planar: NDArray[np.float64], frame_from_plane: Pose) -> NDArray[np.float64]:
    """Return the covariance (6, 6) of a PoseHypothesis from that of x, y, yaw (3, 3) on a plane.

    Height and tilt have the standard deviations ``PLANE_HEIGHT_STD`` and ``PLANE_TILT_STD``.
    """
    covariance = np.zeros((6, 6))
    free = np.ix_((0, 1, 5), (0, 1, 5))
    covariance[free] = planar
    covariance[2, 2], covariance[3, 3], covariance[4, 4] = PLANE_HEIGHT_STD**2, PLANE_TILT_STD**2, PLANE_TILT_STD**2
    turn = np.zeros((6, 6))
    turn[:3, :3] = turn[3:, 3:] = frame_from_plane.rotation
    return turn @ covariance @ turn.T
