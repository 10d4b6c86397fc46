"""Registration of a model surface to the points of a cluster, on the plane that carries it.

The object rests on the measured plane, so only x, y and yaw are free: Gauss-Newton on robust point-to-plane distances
(Chen and Medioni, "Object Modelling by Registration of Multiple Range Images", 1992). Everything here is in the
plane's frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bestman_bt.messages import Pose
from bestman_bt.perception.pose_estimation.model_surface import ModelSurface
from bestman_bt.perception.pose_estimation.point_to_plane import (
    evenly,
    gauss_newton,
    into_model,
    nearest_offsets,
    residual_rows,
)


@dataclass(frozen=True)
class Registration:
    """Fits the surface of a model to the points of a cluster.

    Lengths in metres, angles in radians.

    ``spacing``: of surface samples. ``coarse_points``, ``fine_points``: maximum points of the cluster. ``yaw_step``:
    between starts; ``offsets``: of the starts from the cluster's centre, away from the camera (which sees only the near
    side). ``coarse_iterations``, ``fine_iterations``: of Gauss-Newton; ``coarse_scale``, ``fine_scale``: residuals
    above these are down-weighted (Cauchy). ``refined``: starts that are refined per model; ``yaw_separation``: minimum
    difference of their yaws. ``noise_base``, ``noise_quadratic``: depth noise, as in CameraPart. ``error_factor``,
    ``position_floor``, ``yaw_floor``: standard deviations are those of the residuals times the factor (neighbouring
    residuals are correlated: measured on rendered images) and at least the floor. ``asymmetric_yaw_floor``: for models
    without symmetry, whose yaw depends on few points.
    """

    spacing: Annotated[float, "m"] = 0.003
    coarse_points: int = 120
    fine_points: int = 250
    yaw_step: Annotated[float, "rad"] = math.radians(30.0)
    offsets: Annotated[tuple[float, ...], "m"] = (0.0, 0.012, 0.024)
    coarse_iterations: int = 8
    fine_iterations: int = 6
    coarse_scale: Annotated[float, "m"] = 0.008
    fine_scale: Annotated[float, "m"] = 0.004
    refined: int = 2
    yaw_separation: Annotated[float, "rad"] = math.radians(15.0)
    noise_base: Annotated[float, "m"] = 0.0012
    noise_quadratic: Annotated[float, "1/m"] = 0.0019
    error_factor: float = 2.0
    position_floor: Annotated[float, "m"] = 0.0003
    yaw_floor: Annotated[float, "rad"] = 0.003
    asymmetric_yaw_floor: Annotated[float, "rad"] = 0.017

    def depth_noise(self, points: NDArray[np.float64], eye: NDArray[np.float64]) -> float:
        """Return the standard deviation, metres, expected at the distance of ``points`` (N, 3)."""
        distance = float(np.linalg.norm(points.mean(axis=0) - eye))
        return self.noise_base + self.noise_quadratic * max(0.0, distance - 0.4) ** 2

    def coarse_poses(
        self, surface: ModelSurface, points: NDArray[np.float64], eye: NDArray[np.float64], turns: int, limit: int
    ) -> list[NDArray[np.float64]]:
        """Return the best distinct poses (3,) of all starts, at most ``limit``; ``turns``: symmetry order about z."""
        points = points[evenly(len(points), self.coarse_points)]
        lower, upper = np.percentile(points[:, :2], [2.0, 98.0], axis=0)
        centre = (lower + upper) / 2
        away = centre - eye[:2]
        away /= max(float(np.linalg.norm(away)), 1e-9)
        span = 2 * math.pi / turns if turns else 0.0
        count = max(1, math.ceil(span / self.yaw_step - 1e-9))
        yaws = np.arange(count) * (span / count)
        starts = np.array([[*(centre + offset * away), yaw] for offset in self.offsets for yaw in yaws])
        for iteration in range(self.coarse_iterations):
            moved = into_model(points, starts)
            nearest = surface.nearest_samples(moved)
            scale = self.coarse_scale * (2.0 if iteration < self.coarse_iterations // 2 else 1.0)
            normals = surface.normals[nearest]
            residuals = ((moved - surface.points[nearest]) * normals).sum(axis=2)
            step, _ = gauss_newton(residuals, normals, moved, starts, scale, bool(turns))
            starts = starts + step
        moved = into_model(points, starts)
        distances = np.linalg.norm(moved - surface.points[surface.nearest_samples(moved)], axis=2)
        costs = np.minimum(distances, 0.02).mean(axis=1)
        chosen: list[NDArray[np.float64]] = []
        for i in np.argsort(costs, kind="stable"):
            apart = all(
                np.hypot(*(starts[i, :2] - other[:2])) > 0.006
                or yaw_difference(starts[i, 2] - other[2], turns) > self.yaw_separation
                for other in chosen
            )
            if apart:
                chosen.append(starts[i])
            if len(chosen) == limit:
                break
        return chosen

    def refined_fit(
        self,
        surface: ModelSurface,
        points: NDArray[np.float64],
        eye: NDArray[np.float64],
        start: NDArray[np.float64],
        turns: int,
    ) -> Fit:
        """Return the fit to the samples that face the camera: only one side of a thin wall can have been measured."""
        pose = start[None]
        some = points[evenly(len(points), self.fine_points)]
        # What faces the camera depends on the pose: it is found anew for the second half.
        for iteration in range(self.fine_iterations):
            if iteration in (0, self.fine_iterations // 2):
                seen = _FacingSide(surface, eye, pose)
            moved = into_model(some, pose)
            residuals, directions, places = residual_rows(*seen.nearest(moved[0]), moved[0], self.spacing)
            step, _ = gauss_newton(residuals[None], directions[None], places[None], pose, self.fine_scale, bool(turns))
            pose = pose + step
        return self._judged_fit(surface, points, seen, pose, turns)

    def fit_at(
        self,
        surface: ModelSurface,
        points: NDArray[np.float64],
        eye: NDArray[np.float64],
        pose: NDArray[np.float64],
        turns: int,
    ) -> Fit:
        """Return the residuals and the covariance at ``pose`` (3,)."""
        return self._judged_fit(surface, points, _FacingSide(surface, eye, pose[None]), pose[None], turns)

    def _judged_fit(
        self,
        surface: ModelSurface,
        points: NDArray[np.float64],
        seen: _FacingSide,
        pose: NDArray[np.float64],
        turns: int,
    ) -> Fit:
        moved = into_model(points, pose)
        offsets, normals = seen.nearest(moved[0])
        rows, directions, places = residual_rows(offsets, normals, moved[0], self.spacing)
        _, information = gauss_newton(rows[None], directions[None], places[None], pose, self.fine_scale, bool(turns))
        along = (offsets * normals).sum(axis=1)
        distances = np.linalg.norm(offsets, axis=1)
        beside = distances**2 - along**2 > (2 * self.spacing) ** 2
        residuals = np.where(beside, distances, along)
        sigma = max(float(np.sqrt(np.mean(np.minimum(residuals**2, 0.01**2)))), 1e-4)
        covariance = np.linalg.inv(information[0]) * (self.error_factor * sigma) ** 2
        yaw_floor = self.asymmetric_yaw_floor if turns == 1 else self.yaw_floor
        covariance += np.diag([self.position_floor**2, self.position_floor**2, yaw_floor**2])
        if not turns:
            covariance[2], covariance[:, 2] = 0.0, 0.0
            covariance[2, 2] = math.pi**2
        return Fit(pose[0], residuals, covariance)


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted pose on a plane. ``pose``: (3,), x, y, yaw in the plane's frame, metres and radians; ``covariance``: (3,
    3) of it.

    ``residuals``: (N,), metres, of all points.
    """

    pose: NDArray[np.float64]
    residuals: NDArray[np.float64]
    covariance: NDArray[np.float64]

    def frame_from_object(self, frame_from_plane: Pose, surface: ModelSurface) -> Pose:
        """Return frame_from_object."""
        x, y, yaw = self.pose
        return frame_from_plane @ Pose.from_xyz_rpy((x, y, 0.0), (0.0, 0.0, yaw)) @ surface.rest_from_object

    @property
    def yaw_std(self) -> float:
        """Standard deviation of the yaw, radians."""
        return math.sqrt(float(self.covariance[2, 2]))


def end_aligned_poses(
    surface: ModelSurface, points: NDArray[np.float64], pose: NDArray[np.float64], least: float
) -> list[NDArray[np.float64]]:
    """Return ``pose`` (3,) moved along the model's x and y until an end of the model coincides with an end of the
    points.

    If a part is hidden, registration cannot determine on which side the model continues. Axes along which the model is
    longer than the points by less than ``least`` metres are ignored.
    """
    seen = into_model(points, pose[None])[0]
    options = []
    for axis in range(2):
        lower, upper = np.percentile(seen[:, axis], [1.0, 99.0])
        model_lower, model_upper = surface.points[:, axis].min(), surface.points[:, axis].max()
        hidden = (model_upper - model_lower) - (upper - lower) > least
        options.append([0.0, lower - model_lower, upper - model_upper] if hidden else [0.0])
    c, s = math.cos(pose[2]), math.sin(pose[2])
    shifts = [(x, y) for x in options[0] for y in options[1] if (x, y) != (0.0, 0.0)]
    return [pose + np.array([c * x - s * y, s * x + c * y, 0.0]) for x, y in shifts]


def yaw_difference(angle: float, turns: int) -> float:
    """Return the size of an angle modulo the symmetry, radians."""
    if turns == 0:
        return 0.0
    span = 2 * math.pi / turns
    return abs((angle + span / 2) % span - span / 2)


class _FacingSide:
    """The samples that face the camera when the model stands at ``pose`` (1, 3)."""

    def __init__(self, surface: ModelSurface, eye: NDArray[np.float64], pose: NDArray[np.float64]) -> None:
        towards = into_model(eye[None], pose)[0, 0] - surface.points
        facing = (towards * surface.normals).sum(axis=1) > -0.1 * np.linalg.norm(towards, axis=1)
        self._samples, self._normals = surface.points[facing], surface.normals[facing]
        self._tree = cKDTree(self._samples)

    def nearest(self, moved: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return nearest_offsets(self._tree, self._samples, self._normals, moved)
