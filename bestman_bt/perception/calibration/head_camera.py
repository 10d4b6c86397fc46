"""Extrinsics of a camera on a pan-tilt head: the mount of the head, and the pose of the camera on it.

A fixed board at an unknown place determines the pose of the camera on the head (and so the offset of the tilt encoder,
which is a rotation of the camera about the tilt axis). A board at a known pose in the base frame, carried by the arm or
measured, also determines the pose of the head (and so the offset of the pan encoder, a rotation of the head about the
pan axis). Pradeep, Konolige & Berger, "Calibrating a multi-arm multi-sensor robot: a bundle adjustment approach", ISER
2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import (
    BoardSighting,
    CalibrationError,
    ContradictingViewsError,
    DegenerateMotionError,
    board_pose,
    project,
)
from bestman_bt.perception.calibration.hand_eye_refinement import changed

# Least squares on pixels: the poses at both ends of a robot's chain from camera to board, from reprojection errors.
# ``base → mount → (encoders) → carrier → camera`` must see the board at ``base → (encoders) → holder → board``. Which
# of the three unknowns mount, camera and board are free decides what is calibrated: a wrist camera before a fixed board
# (camera, board), a fixed camera before a board in the hand (camera, board), a pan-tilt head with all three.


Unknown = Literal["mount", "camera", "board"]


@dataclass(frozen=True)
class BoardView:
    """One image: the board's corners, and the forward kinematics of both ends from encoders."""

    sighting: BoardSighting
    mount_from_carrier: Pose = field(default_factory=Pose)
    base_from_holder: Pose = field(default_factory=Pose)


@dataclass(frozen=True)
class ChainPoses:
    """``mount``: base_from_mount; ``camera``: carrier_from_camera; ``board``: holder_from_board."""

    mount: Pose
    camera: Pose
    board: Pose

    def board_in_camera(self, view: BoardView) -> Pose:
        """Return the pose of the board by the kinematic chain."""
        base_from_camera = self.mount @ view.mount_from_carrier @ self.camera
        return base_from_camera.inverse() @ view.base_from_holder @ self.board


@dataclass(frozen=True)
class ChainCalibration:
    """Estimates the poses at both ends of the kinematic chain between camera and board.

    ``outlier``: residual, pixels, above which a corner is down-weighted (soft L1). ``min_views``: minimum number of
    views. ``worst_deviation``: maximum accepted standard deviation of the least certain direction, metres and radians
    as one number. ``view_outlier``: pixels, and ``outlier_ratio``: multiples of the median, above which a view is
    excluded.
    """

    outlier: float = 1.0
    min_views: int = 4
    worst_deviation: float = 0.02
    view_outlier: float = 3.0
    outlier_ratio: float = 4.0

    def calibrate(
        self, views: Sequence[BoardView], intrinsics: CameraIntrinsics, start: ChainPoses, free: Sequence[Unknown]
    ) -> ChainResult:
        """Estimate the ``free`` poses from ``start``; the others are fixed. Views that contradict the others are
        excluded.

        Raises CalibrationError, or DegenerateMotionError if the views do not determine them.
        """
        used = list(range(len(views)))
        while True:
            found = self._by([views[index] for index in used], intrinsics, start, free)
            worst = int(np.argmax(found.errors))
            if found.errors[worst] <= max(self.view_outlier, self.outlier_ratio * float(np.median(found.errors))):
                break
            # The worst alone: it makes others look wrong.
            del used[worst]
            if len(used) < max(self.min_views, 2 * len(views) / 3):
                left = sorted(set(range(len(views))) - set(used))
                raise ContradictingViewsError(left, [str(view) for view in range(len(views))])
        return replace(found, rejected=tuple(sorted(set(range(len(views))) - set(used))))

    def _by(
        self, views: Sequence[BoardView], intrinsics: CameraIntrinsics, start: ChainPoses, free: Sequence[Unknown]
    ) -> ChainResult:
        if len(views) < self.min_views:
            raise CalibrationError(f"at least {self.min_views} views of the board are needed, got {len(views)}")

        def poses(x: NDArray[np.float64]) -> ChainPoses:
            moved = {name: changed(getattr(start, name), x[6 * i : 6 * i + 6]) for i, name in enumerate(free)}
            return replace(start, **moved)

        def offsets(x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
            at = poses(x)
            return [
                project(view.sighting.points, at.board_in_camera(view), intrinsics) - view.sighting.pixels
                for view in views
            ]

        solved = least_squares(
            lambda x: np.concatenate(offsets(x)).ravel(),
            np.zeros(6 * len(free)),
            method="trf",
            x_scale="jac",
            loss="soft_l1",
            f_scale=self.outlier,
            xtol=1e-12,
            ftol=1e-12,
        )
        final = offsets(solved.x)
        errors = np.array([np.sqrt(np.mean(np.sum(offset**2, axis=1))) for offset in final])
        freedom = max(sum(offset.size for offset in final) - len(solved.x), 1)
        variance = max(2.0 * solved.cost / freedom, 1e-6)
        covariance = self._covariance(solved.jac, variance, free)
        blocks = {name: covariance[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] for i, name in enumerate(free)}
        return ChainResult(poses(solved.x), blocks, errors, tuple(final))

    def _covariance(
        self, jacobian: NDArray[np.float64], variance: float, free: Sequence[Unknown]
    ) -> NDArray[np.float64]:
        information, directions = np.linalg.eigh(jacobian.T @ jacobian)
        worst = int(np.argmin(information))
        deviation = float(np.sqrt(variance / max(information[worst], 1e-12)))
        if deviation > self.worst_deviation:
            names = [f"{name} {axis}" for name in free for axis in ("x", "y", "z", "roll", "pitch", "yaw")]
            parts = np.argsort(-np.abs(directions[:, worst]))[:2]
            raise DegenerateMotionError(
                f"the views do not determine {' and '.join(names[part] for part in sorted(parts))}: standard deviation "
                f"{deviation:.3g} m or rad; record views that turn further, about more than one axis"
            )
        return np.asarray((directions / information) @ directions.T * variance)


@dataclass(frozen=True, eq=False)
class ChainResult:
    """Estimated ``poses``; ``covariance``: unknown → (6, 6), metres and radians in the frame in which its pose is
    given.

    ``errors``: root mean square reprojection error of each used view, pixels; ``offsets``: (N, 2) of each, pixels.
    ``rejected``: indices of contradicting views, which were not used.
    """

    poses: ChainPoses
    covariance: dict[Unknown, NDArray[np.float64]]
    errors: NDArray[np.float64]
    offsets: tuple[NDArray[np.float64], ...]
    rejected: tuple[int, ...] = ()


@dataclass(frozen=True)
class HeadAxes:
    """Unit vectors (3,): of the pan joint in the head's mount frame, of the tilt joint in the frame of its link."""

    pan: tuple[float, float, float] = (0.0, 0.0, 1.0)
    tilt: tuple[float, float, float] = (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class HeadCameraResult:
    """Result of a head camera calibration. ``chain``: the poses with covariance and errors. ``free``: names of the
    estimated poses.

    ``pan_offset``, ``tilt_offset``: radians; the correction expressed as encoder errors alone; the pan offset is None
    if the mount was not estimated.
    """

    chain: ChainResult
    free: tuple[Unknown, ...]
    pan_offset: float | None
    tilt_offset: float


def calibrate_head_camera(
    views: Sequence[BoardView],
    intrinsics: CameraIntrinsics,
    mount: Pose,
    camera: Pose,
    board: Pose | None = None,
    axes: HeadAxes = HeadAxes(),
    chain: ChainCalibration | None = None,
) -> HeadCameraResult:
    """Calibrate from ``mount`` (base_from_mount) and ``camera`` (carrier_from_camera) of the robot model.

    ``board``: its measured pose in the base (or on its holder), None if unknown. Raises CalibrationError, or
    DegenerateMotionError if head or arm did not rotate enough.
    """
    held = any(not _same(view.base_from_holder, views[0].base_from_holder) for view in views[1:])
    free: tuple[Unknown, ...] = ("camera",)
    if board is not None or held:
        free = ("mount", *free)
    if board is None:
        free = (*free, "board")
    start = ChainPoses(mount, camera, board or _first_board(views, intrinsics, mount, camera))
    result = (chain or ChainCalibration()).calibrate(views, intrinsics, start, free)
    turned = mount.inverse() @ result.poses.mount
    tilted = result.poses.camera @ camera.inverse()
    pan_offset = _about(turned, axes.pan) if "mount" in free else None
    return HeadCameraResult(result, free, pan_offset, _about(tilted, axes.tilt))


def _first_board(views: Sequence[BoardView], intrinsics: CameraIntrinsics, mount: Pose, camera: Pose) -> Pose:
    """Return the mean of where the uncalibrated chain puts the board on its holder."""
    placed = [
        view.base_from_holder.inverse()
        @ mount
        @ view.mount_from_carrier
        @ camera
        @ board_pose(view.sighting, intrinsics).eye_from_board
        for view in views
    ]
    position = np.mean([pose.position for pose in placed], axis=0)
    return Pose(position, Rotation.from_quat([pose.quaternion for pose in placed]).mean().as_quat())


def _same(a: Pose, b: Pose) -> bool:
    return bool(np.allclose(a.matrix, b.matrix, atol=1e-4))


def _about(correction: Pose, axis: Sequence[float]) -> float:
    turn: NDArray[np.float64] = Rotation.from_quat(correction.quaternion).as_rotvec()
    return float(turn @ np.asarray(axis))
