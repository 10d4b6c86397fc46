"""Intrinsics and lens distortion of a camera from views of a board.

Zhang, "A flexible new technique for camera calibration", IEEE Transactions on Pattern Analysis and Machine Intelligence
2000, as OpenCV computes it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.perception.calibration.boards import BoardSighting, CalibrationError, DegenerateMotionError

COVERAGE_CELLS = (8, 6)
_FIXED = {
    "none": cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    "k1_k2": cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST,
    "k1_k2_p1_p2": cv2.CALIB_FIX_K3,
    "k1_k2_p1_p2_k3": 0,
}


@dataclass(frozen=True)
class IntrinsicsCalibration:
    """Calibrates the intrinsics of a camera from images of a board.

    ``lens``: the estimated distortion coefficients; k3 improves only very wide lenses. ``min_views``, ``min_corners``:
    minimum numbers. ``min_coverage``: fraction of 8 × 6 image cells that must contain a corner. ``min_tilt``: minimum
    tilt of the board against the image plane in at least three views, radians; otherwise focal length and distance
    cannot be separated.
    """

    lens: Literal["none", "k1_k2", "k1_k2_p1_p2", "k1_k2_p1_p2_k3"] = "k1_k2_p1_p2"
    min_views: int = 8
    min_corners: int = 8
    min_coverage: float = 0.6
    min_tilt: float = math.radians(15.0)

    def calibrate(self, sightings: Sequence[BoardSighting | None], size: tuple[int, int]) -> IntrinsicsResult:
        """Calibrate a camera with images of ``size`` (width, height); None is a view without a board. Raises
        CalibrationError or DegenerateMotionError, naming the views to add.
        """
        seen = [(i, s) for i, s in enumerate(sightings) if s is not None and len(s.points) >= self.min_corners]
        if len(seen) < self.min_views:
            raise CalibrationError(
                f"{len(seen)} of {len(sightings)} views show at least {self.min_corners} corners of the board, "
                f"{self.min_views} are needed"
            )
        covered = coverage(np.concatenate([sighting.pixels for _, sighting in seen]), size)
        if covered.mean() < self.min_coverage:
            raise CalibrationError(
                f"the corners cover {covered.mean():.0%} of the image, {self.min_coverage:.0%} are needed; "
                f"show the board {_missing(covered)}"
            )
        error, matrix, distortion, turns, _, deviations, _, errors = cv2.calibrateCameraExtended(
            [sighting.points.astype(np.float32) for _, sighting in seen],
            [sighting.pixels.astype(np.float32) for _, sighting in seen],
            size,
            np.eye(3),
            np.zeros(5),
            flags=_FIXED[self.lens],
        )
        tilts = [math.acos(min(1.0, abs(float(cv2.Rodrigues(turn)[0][2, 2])))) for turn in turns]
        if sum(tilt >= self.min_tilt for tilt in tilts) < 3:
            raise DegenerateMotionError(
                f"fewer than three views show the board leaning by {math.degrees(self.min_tilt):.0f}° or more; "
                "held parallel to the image, focal length and distance cannot be separated"
            )
        if not math.isfinite(error) or not np.isfinite(matrix).all():
            raise CalibrationError("the calibration did not converge; check the number and size of the board's squares")
        coefficients = tuple(float(value) for value in np.ravel(distortion)[:5]) if self.lens != "none" else ()
        intrinsics = CameraIntrinsics(
            *size, float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2]), coefficients
        )
        return IntrinsicsResult(
            intrinsics,
            np.ravel(deviations)[:9].astype(float),
            np.ravel(errors).astype(float),
            tuple(i for i, _ in seen),
            covered,
        )


@dataclass(frozen=True, eq=False)
class IntrinsicsResult:
    """Calibrated ``intrinsics`` with ``standard_deviations`` (9,) of fx, fy, cx, cy, k1, k2, p1, p2, k3.

    ``errors``: root mean square reprojection error of each used view, pixels, and ``used``: their indices.
    ``coverage``: (6, 8) bool, the image cells that contain a corner.
    """

    intrinsics: CameraIntrinsics
    standard_deviations: NDArray[np.float64]
    errors: NDArray[np.float64]
    used: tuple[int, ...]
    coverage: NDArray[np.bool_]

    @property
    def error(self) -> float:
        """Root mean square reprojection error of all views, pixels."""
        return float(np.sqrt(np.mean(self.errors**2)))


def coverage(pixels: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return for each image cell whether it contains one of the pixels (N, 2): (6, 8) bool."""
    across, down = COVERAGE_CELLS
    cells = np.floor((pixels + 0.5) / size * (across, down)).astype(int)
    cells = np.clip(cells, 0, (across - 1, down - 1))
    covered = np.zeros((down, across), dtype=bool)
    covered[cells[:, 1], cells[:, 0]] = True
    return covered


def _missing(covered: NDArray[np.bool_]) -> str:
    """Return words for the quarters of the image that are covered worst."""
    down, across = covered.shape
    shares = {
        f"{'upper' if i == 0 else 'lower'} {'left' if j == 0 else 'right'}": covered[
            i * down // 2 : (i + 1) * down // 2, j * across // 2 : (j + 1) * across // 2
        ].mean()
        for i in (0, 1)
        for j in (0, 1)
    }
    worst = [name for name, share in shares.items() if share <= min(shares.values()) + 0.1]
    return "also in the " + " and the ".join(worst)
