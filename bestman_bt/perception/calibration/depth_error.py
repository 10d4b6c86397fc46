"""The systematic error of a depth sensor, from views of a board whose plane is known from its corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.calibration.boards import BoardSighting, CalibrationError, DegenerateMotionError
from bestman_bt.perception.camera_model import DepthCorrection


@dataclass(frozen=True)
class DepthCalibration:
    """Fits scale and offset of a depth sensor.

    ``margin``: fraction of the visible pattern that is excluded at its border. ``min_pixels``: smallest number of
    pixels per view. ``outlier``: residual, metres, above which a view is down-weighted. ``min_range``: minimum
    difference, metres, between the nearest and the farthest view; otherwise scale and offset cannot be separated.
    """

    margin: float = 0.05
    outlier: float = 0.005
    min_pixels: int = 200
    min_range: float = 0.25

    def calibrate(
        self, views: Sequence[tuple[BoardSighting, Pose, NDArray[np.float32]]], intrinsics: CameraIntrinsics
    ) -> DepthErrorResult:
        """Fit scale and offset.

        ``views``: corners, ``eye_from_board`` computed from them, and the measured depth image (H, W), metres. Raises
        CalibrationError, or DegenerateMotionError if all views have the same distance.
        """
        pairs = [self.measured_and_true(*view, intrinsics) for view in views]
        usable = np.array([pair for pair in pairs if pair is not None]).reshape(-1, 2)
        if len(usable) < 3:
            raise CalibrationError(
                f"{len(usable)} of {len(views)} views have depth on the board, at least 3 are needed"
            )
        measured, true = usable.T
        if np.ptp(true) < self.min_range:
            raise DegenerateMotionError(
                f"all views are from {true.min():.2f} to {true.max():.2f} m: scale and offset of the depth cannot be "
                f"distinguished; record views at least {self.min_range:g} m nearer and farther"
            )
        solved = least_squares(
            lambda x: x[0] * true + x[1] - measured, [1.0, 0.0], loss="soft_l1", f_scale=self.outlier
        )
        residuals = solved.x[0] * true + solved.x[1] - measured
        variance = float(np.sum(residuals**2)) / max(len(true) - 2, 1)
        covariance = variance * np.linalg.inv(solved.jac.T @ solved.jac)
        scale, offset = (float(value) for value in solved.x)
        if not scale > 0.0:
            raise CalibrationError(
                f"measured depths decrease as true ones increase (scale {scale:.3f}): is the depth image aligned?"
            )
        deviations = np.sqrt(np.diag(covariance))
        return DepthErrorResult(
            DepthCorrection(scale, offset), float(deviations[0]), float(deviations[1]), true, residuals
        )

    def measured_and_true(
        self, sighting: BoardSighting, eye_from_board: Pose, depth: NDArray[np.float32], intrinsics: CameraIntrinsics
    ) -> tuple[float, float] | None:
        """Return the medians of measured and true depth, metres, over the pixels that show the pattern.

        None if there are too few such pixels.
        """
        outline = cv2.convexHull(sighting.pixels.astype(np.float32)).reshape(-1, 2)
        middle = outline.mean(axis=0)
        outline = middle + (1.0 - self.margin) * (outline - middle)
        mask = np.zeros(depth.shape, dtype=np.uint8)
        cv2.fillConvexPoly(mask, np.rint(outline).astype(np.int32), 1)
        v, u = np.nonzero((mask > 0) & np.isfinite(depth) & (depth > 0.0))
        if len(u) < self.min_pixels:
            return None
        pixels = np.stack([u, v], axis=1).astype(float).reshape(-1, 1, 2)
        rays = cv2.undistortPoints(pixels, intrinsics.matrix, np.array(intrinsics.distortion)).reshape(-1, 2)
        normal = eye_from_board.rotation[:, 2]
        true = normal @ eye_from_board.position / (rays @ normal[:2] + normal[2])
        # The median of the difference is robust against holes and edges; both ends are told at the mean distance.
        difference = float(np.median(depth[v, u] - true))
        at = float(np.mean(true))
        return at + difference, at


@dataclass(frozen=True, eq=False)
class DepthErrorResult:
    """A fitted depth ``correction`` with standard deviations of scale and offset; ``residuals`` (N,): metres, per view.

    ``distances`` (N,): distance of each view from its corners, metres.
    """

    correction: DepthCorrection
    scale_std: float
    offset_std: float
    distances: NDArray[np.float64]
    residuals: NDArray[np.float64]
