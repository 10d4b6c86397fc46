"""The pose of a square marker from its four corners, by perspective and, where it was measured, by depth.

A small square seen nearly without perspective has two poses that explain its corners about equally well: Collins and
Bartoli, "Infinitesimal Plane-Based Pose Estimation", 2014 (IPPE). Both are refined by least squares on the corners and
the measured depth of the marker's face; which one is right, and how sure that is, the difference of their costs says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.messages.frozen_array import frozen_array
from bestman_bt.perception.errors import PerceptionError


@dataclass(frozen=True)
class ArucoPnpParameters:
    """``corner_std``: of a corner, pixels. ``noise_base``, ``noise_quadratic``: of depth, metres, as in CameraPart.

    ``depth_points``: of the face, at most; fewer than ``min_depth_points`` are not used. ``depth_tolerance``: metres,
    farther from the face's median depth plane lies something else. ``ambiguity``: the other pose is told where its cost
    (sum of squares, each in standard deviations) is greater by less than this.
    """

    corner_std: float = 0.4
    noise_base: float = 0.0012
    noise_quadratic: float = 0.0019
    depth_points: int = 200
    min_depth_points: int = 30
    depth_tolerance: float = 0.02
    ambiguity: float = 12.0


@dataclass(frozen=True, eq=False)
class MarkerPose:
    """``camera_from_marker``: x to the marker's right, y to its top, z out of its face; metres.

    ``covariance``: (6, 6) of x, y, z and turns about x, y, z of the camera's frame (metres, radians).
    ``reprojection_error``: root mean square over the corners, pixels. ``alternative``: the other pose that the image
    leaves open, None where it is ruled out; ``alternative_error``: its reprojection error. ``depth_points``: how many
    measurements of depth took part.
    """

    camera_from_marker: Pose
    covariance: NDArray[np.float64]
    reprojection_error: float
    alternative: Pose | None
    alternative_error: float
    depth_points: int

    def __post_init__(self) -> None:
        object.__setattr__(self, "covariance", frozen_array(self.covariance, (6, 6), "MarkerPose covariance"))

    @property
    def ambiguous(self) -> bool:
        """Whether the marker may also be tilted the other way."""
        return self.alternative is not None


class ArucoPnp:
    """See the module."""

    def __init__(self, parameters: ArucoPnpParameters | None = None) -> None:
        self.parameters = parameters or ArucoPnpParameters()

    def estimate(
        self, corners: ArrayLike, size: float, intrinsics: CameraIntrinsics, depth: NDArray[np.float32] | None = None
    ) -> MarkerPose:
        """Pose of a marker of edge ``size`` metres.

        ``corners``: (4, 2) pixels, top left, top right, bottom right, bottom left of the marker as it is printed.
        ``depth``: (H, W) metres, 0 where unknown. Raises PerceptionError for corners that are no square in space.
        """
        p = self.parameters
        pixels = _checked(corners, size, intrinsics, depth)
        half = size / 2
        square = np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])
        found, rotations, translations, _ = cv2.solvePnPGeneric(
            square, pixels, intrinsics.matrix, None, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        starts = [
            np.concatenate([t.ravel(), r.ravel()])
            for r, t in zip(rotations, translations, strict=True)
            if np.isfinite(r).all() and np.isfinite(t).all() and t.ravel()[2] > 0
        ]
        if not found or not starts:
            raise PerceptionError(f"the corners {pixels.tolist()} are no marker of {size} m in front of the camera")
        face = np.zeros((0, 3)) if depth is None else self._face(pixels, depth, intrinsics)
        problem = _Problem(square, pixels, face, intrinsics, p.corner_std, self._noise(face))
        fits = sorted((problem.fitted(start) for start in starts), key=lambda fit: fit[1])
        (best, cost, jacobian), *others = fits
        degrees = 8 + len(face) - 6
        covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian) * max(1.0, cost / degrees), dtype=np.float64)
        other = others[0][0] if others and others[0][1] - cost < p.ambiguity and _differ(best, others[0][0]) else None
        return MarkerPose(
            camera_from_marker=_pose(best),
            covariance=covariance,
            reprojection_error=problem.reprojection_error(best),
            alternative=None if other is None else _pose(other),
            alternative_error=math.inf if other is None else problem.reprojection_error(other),
            depth_points=len(face),
        )

    def _face(
        self, pixels: NDArray[np.float64], depth: NDArray[np.float32], k: CameraIntrinsics
    ) -> NDArray[np.float64]:
        """Measured points (M, 3) of the marker's face, camera frame; (0, 3) where there are too few."""
        p = self.parameters
        # The rim may show what is behind the marker.
        inner = pixels.mean(axis=0) + 0.8 * (pixels - pixels.mean(axis=0))
        mask = np.zeros(depth.shape, np.uint8)
        cv2.fillConvexPoly(mask, np.rint(inner).astype(np.int32), 1)
        v, u = np.nonzero((mask > 0) & np.isfinite(depth) & (depth > 0))
        z = depth[v, u].astype(np.float64)
        points = np.stack([(u - k.cx) / k.fx * z, (v - k.cy) / k.fy * z, z], axis=1)
        if len(points) < p.min_depth_points:
            return np.zeros((0, 3))
        for _ in range(3):
            columns = np.column_stack([points[:, :2], np.ones(len(points))])
            plane = np.linalg.lstsq(columns, points[:, 2], rcond=None)[0]
            kept = np.abs(columns @ plane - points[:, 2]) < p.depth_tolerance
            if kept.all() or kept.sum() < p.min_depth_points:
                break
            points = points[kept]
        step = max(1, math.ceil(len(points) / p.depth_points))
        return points[::step]

    def _noise(self, face: NDArray[np.float64]) -> float:
        p = self.parameters
        distance = float(np.median(face[:, 2])) if len(face) else 0.0
        return p.noise_base + p.noise_quadratic * max(0.0, distance - 0.4) ** 2


class _Problem:
    """Residuals of a pose (6,) as translation and rotation vector, in standard deviations."""

    def __init__(
        self,
        square: NDArray[np.float64],
        pixels: NDArray[np.float64],
        face: NDArray[np.float64],
        k: CameraIntrinsics,
        corner_std: float,
        depth_std: float,
    ) -> None:
        self.square, self.pixels, self.face = square, pixels, face
        self.k, self.corner_std, self.depth_std = k, corner_std, depth_std

    def fitted(self, start: NDArray[np.float64]) -> tuple[NDArray[np.float64], float, NDArray[np.float64]]:
        """The best pose near ``start``, its cost, and the Jacobian (R, 6) to moves and turns in the camera's frame."""
        solved = least_squares(self._residuals, start, x_scale=[0.01] * 3 + [0.05] * 3, method="trf")
        pose = np.asarray(solved.x)
        rotation = _rotation(pose[3:])

        def moved(step: NDArray[np.float64]) -> NDArray[np.float64]:
            return self._residuals_at(pose[:3] + step[:3], _rotation(step[3:]) @ rotation)

        sizes = np.array([1e-6] * 3 + [1e-6] * 3)
        jacobian = [(moved(step) - moved(-step)) / (2 * step.sum()) for step in np.diag(sizes)]
        return pose, float(2.0 * solved.cost), np.stack(jacobian, axis=1)

    def reprojection_error(self, pose: NDArray[np.float64]) -> float:
        """Root mean square over the corners, pixels."""
        errors = self._corner_errors(pose[:3], _rotation(pose[3:]))
        return float(np.sqrt(np.mean((errors**2).sum(axis=1))))

    def _residuals(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._residuals_at(pose[:3], _rotation(pose[3:]))

    def _residuals_at(self, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        corners = self._corner_errors(position, rotation).ravel() / self.corner_std
        # Along the line of sight, which is where depth errs.
        normal = rotation[:, 2]
        along = self.face[:, 2] - self.face[:, 2] * (normal @ position) / _away_from_zero(self.face @ normal)
        return np.concatenate([corners, np.clip(along / self.depth_std, -1e3, 1e3)])

    def _corner_errors(self, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = (self.square @ rotation.T + position).T
        z = np.maximum(z, 1e-6)
        projected = np.stack([self.k.cx + self.k.fx * x / z, self.k.cy + self.k.fy * y / z], axis=1)
        errors: NDArray[np.float64] = projected - self.pixels
        return errors


def _away_from_zero(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.where(np.abs(values) < 1e-6, np.copysign(1e-6, values), values)


def _checked(
    corners: ArrayLike, size: float, intrinsics: CameraIntrinsics, depth: NDArray[np.float32] | None
) -> NDArray[np.float64]:
    pixels = np.asarray(corners, dtype=np.float64)
    if pixels.shape != (4, 2) or not np.isfinite(pixels).all():
        raise PerceptionError(f"marker corners should be four finite pixels, (4, 2), got {pixels.shape}: {pixels}")
    if not (math.isfinite(size) and size > 0):
        raise PerceptionError(f"a marker's size should be above 0 m, got {size}")
    if intrinsics.distortion:
        raise PerceptionError("marker corners should come from a rectified image, got intrinsics with distortion")
    if depth is not None and depth.shape != (intrinsics.height, intrinsics.width):
        wanted = (intrinsics.height, intrinsics.width)
        raise PerceptionError(f"depth should have the shape of the image, {wanted}, got {depth.shape}")
    sides = np.roll(pixels, -1, axis=0) - pixels
    turns = sides[:, 0] * np.roll(sides[:, 1], -1) - sides[:, 1] * np.roll(sides[:, 0], -1)
    if not (turns > 1.0).all():
        raise PerceptionError(
            f"marker corners should run clockwise around a convex quadrilateral of more than a few pixels, got {pixels}"
        )
    return pixels


def _differ(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether the two are tilted differently, by more than 1°."""
    cosine = _rotation(one[3:])[:, 2] @ _rotation(other[3:])[:, 2]
    return bool(cosine < math.cos(math.radians(1.0)))


def _rotation(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cv2.Rodrigues(vector)[0], dtype=np.float64)


def _pose(pose: NDArray[np.float64]) -> Pose:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = _rotation(pose[3:]), pose[:3]
    return Pose.from_matrix(matrix)
