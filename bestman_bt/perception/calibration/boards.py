"""Calibration boards: flat patterns whose corners are known exactly and found to a fraction of a pixel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from typing_extensions import override

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.perception.errors import PerceptionError


class CalibrationError(PerceptionError):
    """Raised if a calibration cannot be computed; the message gives the views to record instead."""


class DegenerateMotionError(CalibrationError):
    """The recorded motions do not determine all unknowns; further views of the same kind do not help."""


class ContradictingViewsError(CalibrationError):
    """Raised if too many views contradict each other to determine the correct ones; ``views``: their indices."""

    def __init__(self, views: Sequence[int], names: Sequence[str]) -> None:
        self.views = tuple(views)
        super().__init__(
            f"{len(self.views)} of {len(names)} views contradict the others: "
            f"{', '.join(names[view] for view in self.views)}; see that the poses belong to the images, that the board "
            "stands still where it should, and record them again"
        )


@dataclass(frozen=True, eq=False)
class BoardSighting:
    """Corners detected in one image: ``points`` (N, 3) metres in the board frame, ``pixels`` (N, 2) as (u, v).

    The board frame has its origin at a corner of the pattern, x along its columns and y along its rows.
    """

    points: NDArray[np.float64]
    pixels: NDArray[np.float64]


@dataclass(frozen=True)
class Board(ABC):
    """A board with ``columns`` × ``rows`` squares of ``square`` metres."""

    columns: int
    rows: int
    square: float

    @property
    def size(self) -> tuple[float, float]:
        """Extents (x, y) of the pattern, metres."""
        return self.columns * self.square, self.rows * self.square

    @property
    @abstractmethod
    def shows_orientation(self) -> bool:
        """Return whether an image determines the board's orientation; calibrations of poses need it."""

    @abstractmethod
    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        """Return the corners in an (H, W, 3) image, or None if there are fewer than six, or all are collinear."""


@dataclass(frozen=True)
class CharucoBoard(Board):
    """A chessboard with ArUco markers of ``marker`` metres in its white squares; it may be partly hidden.

    ``dictionary``: of OpenCV, for example DICT_4X4_50. Raises CalibrationError for impossible dimensions.

    Garrido-Jurado et al., "Automatic generation and detection of highly reliable fiducial markers under occlusion",
    Pattern Recognition 2014.
    """

    marker: float
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 3 or not 0.0 < self.marker < self.square:
            raise CalibrationError(
                f"a ChArUco board has at least 3 × 3 squares and markers smaller than them, not {self}"
            )
        names = sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_"))
        if self.dictionary not in names:
            raise CalibrationError(f"no ArUco dictionary {self.dictionary!r}; there are {', '.join(names)}")
        needed, there = self.columns * self.rows // 2, len(_dictionary(self.dictionary).bytesList)
        if needed > there:
            raise CalibrationError(f"{self} needs {needed} markers, {self.dictionary} has {there}")

    @property
    def shows_orientation(self) -> bool:
        """Return True: the markers determine the orientation."""
        return True

    @override
    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        corners, ids, _, _ = self._detector.detectBoard(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
        if corners is None or ids is None:
            return None
        order = np.argsort(ids.ravel())
        points = np.asarray(self._board.getChessboardCorners(), dtype=float)[ids.ravel()[order]]
        return _sighting(points, np.asarray(corners, dtype=float).reshape(-1, 2)[order])

    def picture(self, pixels_per_square: int) -> NDArray[np.uint8]:
        """Return the pattern, (rows * n, columns * n) uint8, to print or to draw; x along the columns, y along the
        rows.
        """
        across, down = self.columns * pixels_per_square, self.rows * pixels_per_square
        return np.asarray(self._board.generateImage((across, down)), dtype=np.uint8)

    @cached_property
    def _board(self) -> Any:
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, _dictionary(self.dictionary))

    @cached_property
    def _detector(self) -> Any:
        return cv2.aruco.CharucoDetector(self._board)


@dataclass(frozen=True)
class Checkerboard(Board):
    """A plain chessboard that must be fully visible; suitable for intrinsics, but not for poses, because of its
    half-turn symmetry.

    Duda & Frese, "Accurate detection and localization of checkerboard corners for calibration", BMVC 2018.
    """

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 4 or not self.square > 0.0:
            raise CalibrationError(f"a checkerboard has at least 4 × 4 squares of positive size, not {self}")

    @property
    def shows_orientation(self) -> bool:
        """Return False: the board looks the same after half a turn."""
        return False

    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        """Return all corners in an (H, W, 3) image, or None if one of them is missing."""
        inner = (self.columns - 1, self.rows - 1)
        found, corners = cv2.findChessboardCornersSB(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), inner)
        if not found:
            return None
        x, y = np.meshgrid(np.arange(1, self.columns), np.arange(1, self.rows))
        points = np.stack([x.ravel() * self.square, y.ravel() * self.square, np.zeros(x.size)], axis=1)
        return _sighting(points, np.asarray(corners, dtype=float).reshape(-1, 2))


def _dictionary(name: str) -> Any:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def _sighting(points: NDArray[np.float64], pixels: NDArray[np.float64]) -> BoardSighting | None:
    if len(points) < 6:
        return None
    spread = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), compute_uv=False)
    return BoardSighting(points, pixels) if spread[1] > 1e-6 else None


# The pose of a board in the camera that sees it.
# Collins & Bartoli, "Infinitesimal plane-based pose estimation", International Journal of Computer Vision 2014, then
# least squares on the reprojection error.


@dataclass(frozen=True)
class BoardPose:
    """The pose ``eye_from_board`` of a board in one image; ``error``: root mean square reprojection error, pixels.

    ``ambiguity``: error of this pose divided by that of the mirrored pose; near 1 the tilt of the board is ambiguous.
    """

    eye_from_board: Pose
    error: float
    ambiguity: float


def board_pose(sighting: BoardSighting, intrinsics: CameraIntrinsics) -> BoardPose:
    """Return the pose of the board that explains the sighting best. Raises CalibrationError if none does."""
    matrix, distortion = intrinsics.matrix, np.array(intrinsics.distortion)
    points, pixels = sighting.points.reshape(-1, 1, 3), sighting.pixels.reshape(-1, 1, 2)
    count, turns, positions, errors = cv2.solvePnPGeneric(points, pixels, matrix, distortion, flags=cv2.SOLVEPNP_IPPE)
    if not count:
        raise CalibrationError(f"no pose of the board explains the {len(points)} corners that were found")
    turn, position = cv2.solvePnPRefineLM(points, pixels, matrix, distortion, turns[0], positions[0])
    pose = Pose(np.ravel(position), Rotation.from_rotvec(np.ravel(turn)).as_quat())
    offsets = project(sighting.points, pose, intrinsics) - sighting.pixels
    error = float(np.sqrt(np.mean(np.sum(offsets**2, axis=1))))
    others = np.ravel(errors)
    ambiguity = float(others[0] / max(others[1], 1e-9)) if len(others) > 1 else 0.0
    return BoardPose(pose, error, ambiguity)


def project(points: NDArray[np.float64], eye_from_points: Pose, intrinsics: CameraIntrinsics) -> NDArray[np.float64]:
    """Return the pixels (N, 2) of points (N, 3), metres, including lens distortion."""
    k = intrinsics
    x, y, z = eye_from_points.apply(points).T
    x, y = x / z, y / z
    k1, k2, p1, p2, k3 = (*k.distortion, 0.0, 0.0, 0.0, 0.0, 0.0)[:5]
    r2 = x * x + y * y
    radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
    bent_y = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
    return np.stack([k.cx + k.fx * bent_x, k.cy + k.fy * bent_y], axis=1)
