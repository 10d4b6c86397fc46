"""Extrinsics of a camera on a pan-tilt head: where the head stands, and how the camera sits on it.

A board that stands still at an unknown place tells how the camera sits on the head (and so the offset of the tilt
encoder, which is a turn of the camera about the tilt axis). A board whose place in the base is known, because the arm
carries it or it was measured, tells in addition where the head stands (and so the offset of the pan encoder, a turn of
the head about the pan axis). Pradeep, Konolige & Berger, "Calibrating a multi-arm multi-sensor robot: a bundle
adjustment approach", ISER 2010.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.board_chain import (
    BoardView,
    ChainCalibration,
    ChainPoses,
    ChainResult,
    Unknown,
)
from bestman_bt.perception.calibration.board_pose import board_pose


@dataclass(frozen=True)
class HeadAxes:
    """Unit vectors (3,): of the pan joint in the head's mount frame, of the tilt joint in the frame of its link."""

    pan: tuple[float, float, float] = (0.0, 0.0, 1.0)
    tilt: tuple[float, float, float] = (0.0, 1.0, 0.0)


@dataclass(frozen=True, eq=False)
class HeadCameraResult:
    """``chain``: the poses with covariance and errors. ``free``: which of them were estimated.

    ``pan_offset``, ``tilt_offset``: radians that the poses put right, as if they were errors of the encoders alone; the
    pan offset is None where the mount was not estimated.
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
    """Calibrate from ``mount`` (base_from_mount) and ``camera`` (carrier_from_camera), as the robot model has them.

    ``board``: its measured pose in the base (or on its holder), None where it is not known. Raises CalibrationError, or
    DegenerateMotionError where head or arm did not turn enough.
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
    """The mean of where the uncalibrated chain puts the board on its holder."""
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
