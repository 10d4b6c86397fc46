"""Registration of model surfaces to a cluster from many starts, judged against the whole image.

The object rests on the measured plane, so only x, y and yaw are free: Gauss-Newton on robust point-to-plane distances
(Chen and Medioni, "Object Modelling by Registration of Multiple Range Images", 1992), all starts at once. The best
ones are refined on the part of the surface that faces the camera, and judged: does the model explain the points, would
some of it hover in front of measured depth, is the colour right?
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import Box, ObjectModel, Pose, YawSet
from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.evidence import ConfidenceModel, Evidence, color_distance, judge
from bestman_bt.perception.pose_estimation.model_surface import ModelSurface, model_surface
from bestman_bt.perception.pose_estimation.point_to_plane import (
    evenly,
    gauss_newton,
    into_model,
    nearest_offsets,
    residual_rows,
)
from bestman_bt.perception.segmentation.base import Cluster
from bestman_bt.perception.view import View


@dataclass(frozen=True)
class MultiStartParameters:
    """Lengths in metres, angles in radians.

    ``spacing``: of surface samples. ``coarse_points``, ``fine_points``: of the cluster, at most. ``yaw_step``: between
    starts; ``offsets``: of the starts from the cluster's centre, away from the camera (which sees only the near side).
    ``coarse_iterations``, ``fine_iterations``: of Gauss-Newton; ``coarse_scale``, ``fine_scale``: residuals beyond
    these count less (Cauchy). ``refined``: starts that are refined per model. ``size_tolerance``: a model is not tried
    where its height or reach is off by more, or its colour distance is beyond ``color_limit``.
    ``tipped``: also try objects that lie on their side.
    ``noise_base``, ``noise_quadratic``: of depth, as in CameraModel. ``yaw_margin``: how much lower an alternative
    yaw's logit of confidence may be; ``yaw_separation``: how far off it must be.
    """

    spacing: float = 0.003
    coarse_points: int = 120
    fine_points: int = 250
    yaw_step: float = math.radians(30.0)
    offsets: tuple[float, ...] = (0.0, 0.012, 0.024)
    coarse_iterations: int = 8
    fine_iterations: int = 6
    coarse_scale: float = 0.008
    fine_scale: float = 0.004
    refined: int = 2
    size_tolerance: float = 0.022
    color_limit: float = 0.15
    tipped: bool = False
    noise_base: float = 0.0012
    noise_quadratic: float = 0.0019
    yaw_margin: float = 3.0
    yaw_separation: float = math.radians(15.0)
    confidence: ConfidenceModel = field(default_factory=ConfidenceModel)


class MultiStart(PoseEstimator):
    """See the module. It keeps the sampled surfaces of the models that it has met."""

    def __init__(self, parameters: MultiStartParameters | None = None) -> None:
        self.parameters = parameters or MultiStartParameters()
        self._surfaces: dict[ObjectModel, tuple[ModelSurface, ...]] = {}

    def estimate(self, cluster: Cluster, models: Sequence[ObjectModel], view: View) -> tuple[PoseHypothesis, ...]:
        """See PoseEstimator."""
        plane_from_frame = cluster.plane.frame_from_plane.inverse()
        points = plane_from_frame.apply(cluster.points)
        eye = plane_from_frame.apply(view.viewpoint)
        found = []
        for model in models:
            best = self._fit_model(model, points, eye, cluster, view)
            if best is not None:
                found.append(best)
        found.sort(key=lambda hypothesis: -hypothesis.confidence)
        return tuple(found)

    def _fit_model(
        self,
        model: ObjectModel,
        points: NDArray[np.float64],
        eye: NDArray[np.float64],
        cluster: Cluster,
        view: View,
    ) -> PoseHypothesis | None:
        p = self.parameters
        top = float(np.percentile(points[:, 2], 98.0))
        box = cluster.bounding_box.shape
        assert isinstance(box, Box)
        reach = math.hypot(*box.size[:2])
        color = color_distance(cluster.colors, model.color)
        if color > p.color_limit:
            return None
        fits: list[tuple[float, ModelSurface, _Fit, Evidence]] = []
        for index, surface in enumerate(self._surfaces_of(model)):
            if abs(surface.height - top) > p.size_tolerance or reach > surface.reach + p.size_tolerance:
                continue
            turns = model.symmetry_order if index == 0 else 2
            for start in self._coarse(surface, points, eye, turns):
                fit = self._refine(surface, points, eye, start, turns)
                frame_from_object = _place(cluster, surface, fit)
                evidence = judge(surface, frame_from_object, fit.residuals, cluster, view, self._noise(cluster, view))
                fits.append((p.confidence.logit(evidence, color), surface, fit, evidence))
        if not fits:
            return None
        fits.sort(key=lambda item: -item[0])
        logit, surface, fit, evidence = fits[0]
        pose = _place(cluster, surface, fit)
        upright = surface is self._surfaces_of(model)[0]
        alternatives = [
            _place(cluster, other, other_fit).yaw
            for other_logit, other, other_fit, _ in fits[1:]
            if other is surface
            and logit - other_logit < p.yaw_margin
            and _yaw_difference(fit.yaw - other_fit.yaw, model.symmetry_order) > p.yaw_separation
        ]
        yaws = [pose.yaw, *alternatives] if model.symmetry_order else []
        return PoseHypothesis(
            model=model,
            pose=pose,
            confidence=1.0 / (1.0 + math.exp(-logit)),
            covariance=np.diag([fit.position_std**2] * 2 + [0.001**2, 0.0, 0.0, fit.yaw_std**2]),
            yaw_set=YawSet(tuple((yaw, 2.0 * fit.yaw_std) for yaw in yaws)),
            rmse=evidence.rmse,
            explained=evidence.explained,
            visible_fraction=evidence.visible_fraction,
            floating=evidence.floating,
            color_distance=color,
            upright=upright,
        )

    def _surfaces_of(self, model: ObjectModel) -> tuple[ModelSurface, ...]:
        if model not in self._surfaces:
            quarter = math.pi / 2
            orientations = [Pose()]
            if self.parameters.tipped:
                orientations.append(Pose.from_xyz_rpy((0, 0, 0), (quarter, 0, 0)))
                if model.symmetry_order not in (0, 4):
                    orientations.append(Pose.from_xyz_rpy((0, 0, 0), (0, quarter, 0)))
            surfaces = tuple(model_surface(model, pose, self.parameters.spacing) for pose in orientations)
            self._surfaces[model] = surfaces
        return self._surfaces[model]

    def _noise(self, cluster: Cluster, view: View) -> float:
        distance = float(np.linalg.norm(cluster.points.mean(axis=0) - view.viewpoint))
        return self.parameters.noise_base + self.parameters.noise_quadratic * max(0.0, distance - 0.4) ** 2

    def _coarse(
        self, surface: ModelSurface, points: NDArray[np.float64], eye: NDArray[np.float64], turns: int
    ) -> list[NDArray[np.float64]]:
        """The best distinct results (x, y, yaw) of all starts."""
        p = self.parameters
        points = points[evenly(len(points), p.coarse_points)]
        lower, upper = np.percentile(points[:, :2], [2.0, 98.0], axis=0)
        centre = (lower + upper) / 2
        away = centre - eye[:2]
        away /= max(float(np.linalg.norm(away)), 1e-9)
        span = 2 * math.pi / turns if turns else 0.0
        count = max(1, math.ceil(span / p.yaw_step - 1e-9))
        yaws = np.arange(count) * (span / count)
        starts = np.array([[*(centre + offset * away), yaw] for offset in p.offsets for yaw in yaws])
        for iteration in range(p.coarse_iterations):
            nearest, moved = _match(surface, points, starts)
            scale = p.coarse_scale * (2.0 if iteration < p.coarse_iterations // 2 else 1.0)
            normals = surface.normals[nearest]
            residuals = ((moved - surface.points[nearest]) * normals).sum(axis=2)
            step, _ = gauss_newton(residuals, normals, moved, starts, scale, bool(turns))
            starts = starts + step
        nearest, moved = _match(surface, points, starts)
        distances = np.linalg.norm(moved - surface.points[nearest], axis=2)
        costs = np.minimum(distances, 0.02).mean(axis=1)
        chosen: list[NDArray[np.float64]] = []
        for i in np.argsort(costs, kind="stable"):
            apart = all(
                np.hypot(*(starts[i, :2] - other[:2])) > 0.006
                or _yaw_difference(starts[i, 2] - other[2], turns) > p.yaw_separation
                for other in chosen
            )
            if apart:
                chosen.append(starts[i])
            if len(chosen) == (p.refined if turns != 1 else 2 * p.refined):
                break
        return chosen

    def _refine(
        self,
        surface: ModelSurface,
        points: NDArray[np.float64],
        eye: NDArray[np.float64],
        start: NDArray[np.float64],
        turns: int,
    ) -> _Fit:
        """Fit to the samples that face the camera: of a thin wall only one side can have been measured."""
        p = self.parameters
        pose = start[None]
        some = points[evenly(len(points), p.fine_points)]
        # What faces the camera depends on the pose: it is found anew for the second half.
        for iteration in range(p.fine_iterations):
            if iteration in (0, p.fine_iterations // 2):
                towards = into_model(eye[None], pose)[0, 0] - surface.points
                facing = (towards * surface.normals).sum(axis=1) > -0.1 * np.linalg.norm(towards, axis=1)
                samples, normals = surface.points[facing], surface.normals[facing]
                tree = cKDTree(samples)
            moved = into_model(some, pose)
            offsets, normals_at = nearest_offsets(tree, samples, normals, moved[0])
            residuals, directions, places = residual_rows(offsets, normals_at, moved[0], p.spacing)
            step, _ = gauss_newton(residuals[None], directions[None], places[None], pose, p.fine_scale, bool(turns))
            pose = pose + step
        moved = into_model(points, pose)
        offsets, normals_at = nearest_offsets(tree, samples, normals, moved[0])
        residuals, directions, places = residual_rows(offsets, normals_at, moved[0], p.spacing)
        _, information = gauss_newton(residuals[None], directions[None], places[None], pose, p.fine_scale, bool(turns))
        along = (offsets * normals_at).sum(axis=1)
        distances = np.linalg.norm(offsets, axis=1)
        beside = distances**2 - along**2 > (2 * p.spacing) ** 2
        residuals = np.where(beside, distances, along)
        sigma = max(float(np.sqrt(np.mean(np.minimum(residuals**2, 0.01**2)))), 1e-4)
        covariance = np.linalg.inv(information[0]) * sigma**2
        # Neighbouring residuals are not independent: the factor is measured on rendered images.
        position_std = 2.0 * math.sqrt(float(covariance[0, 0] + covariance[1, 1]) / 2) + 0.0003
        yaw_std = 2.0 * math.sqrt(float(covariance[2, 2])) + 0.003 if turns else math.pi
        x, y, yaw = (float(value) for value in pose[0])
        return _Fit(x, y, yaw, residuals, position_std, min(yaw_std, math.pi))


@dataclass(frozen=True, eq=False)
class _Fit:
    """Pose on the plane (plane frame), signed residuals (N,) in metres, standard deviations."""

    x: float
    y: float
    yaw: float
    residuals: NDArray[np.float64]
    position_std: float
    yaw_std: float


def _match(
    surface: ModelSurface, points: NDArray[np.float64], poses: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    moved = into_model(points, poses)
    return surface.nearest_samples(moved), moved


def _place(cluster: Cluster, surface: ModelSurface, fit: _Fit) -> Pose:
    plane_from_rest = Pose.from_xyz_rpy((fit.x, fit.y, 0.0), (0.0, 0.0, fit.yaw))
    return cluster.plane.frame_from_plane @ plane_from_rest @ surface.rest_from_object


def _yaw_difference(angle: float, turns: int) -> float:
    """Size of an angle modulo the symmetry, radians."""
    if turns == 0:
        return 0.0
    span = 2 * math.pi / turns
    return abs((angle + span / 2) % span - span / 2)
