"""Least squares on pixels: the poses at both ends of a robot's chain from camera to board, from reprojection errors.

``base → mount → (encoders) → carrier → camera`` must see the board at ``base → (encoders) → holder → board``. Which of
the three unknowns mount, camera and board are free decides what is calibrated: a wrist camera before a fixed board
(camera, board), a fixed camera before a board in the hand (camera, board), a pan-tilt head with all three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.board_pose import project
from bestman_bt.perception.calibration.boards import BoardSighting
from bestman_bt.perception.calibration.errors import CalibrationError, DegenerateMotionError
from bestman_bt.perception.calibration.hand_eye_refinement import changed

Unknown = Literal["mount", "camera", "board"]


@dataclass(frozen=True)
class BoardView:
    """One image: the board's corners, and what the encoders told of both ends."""

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
        """Where the chain puts the board."""
        base_from_camera = self.mount @ view.mount_from_carrier @ self.camera
        return base_from_camera.inverse() @ view.base_from_holder @ self.board


@dataclass(frozen=True)
class ChainCalibration:
    """Finds the poses at both ends of the chain.

    ``outlier``: pixels from which on a corner counts less (soft L1). ``min_views``: fewer are refused.

    ``worst_deviation``: metres and radians (as one number) of the least certain direction that are accepted.
    """

    outlier: float = 1.0
    min_views: int = 4
    worst_deviation: float = 0.02

    def calibrate(
        self, views: Sequence[BoardView], intrinsics: CameraIntrinsics, start: ChainPoses, free: Sequence[Unknown]
    ) -> ChainResult:
        """Find the ``free`` poses from ``start``; the others stay.

        Raises CalibrationError, or DegenerateMotionError if the views do not determine them.
        """
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
    """``poses``; ``covariance``: unknown → (6, 6), metres and radians in the frame that its pose is given in.

    ``errors``: root mean square reprojection error of each view, pixels; ``offsets``: (N, 2) of each view, pixels.
    """

    poses: ChainPoses
    covariance: dict[Unknown, NDArray[np.float64]]
    errors: NDArray[np.float64]
    offsets: tuple[NDArray[np.float64], ...]
