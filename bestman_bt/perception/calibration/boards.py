"""Calibration boards: flat patterns whose corners are known exactly and found to a fraction of a pixel."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bestman_bt.perception.calibration.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class BoardSighting:
    """Corners that one image shows: ``points`` (N, 3) metres in the board frame, ``pixels`` (N, 2) as (u, v).

    The board frame has its origin at a corner of the pattern, x along its columns and y along its rows.
    """

    points: NDArray[np.float64]
    pixels: NDArray[np.float64]


class Board(ABC):
    """A board with ``columns`` × ``rows`` squares of ``square`` metres."""

    @property
    @abstractmethod
    def size(self) -> tuple[float, float]:
        """Extents (x, y) of the pattern, metres."""

    @property
    @abstractmethod
    def corner_count(self) -> int:
        """How many corners a complete sighting has."""

    @property
    @abstractmethod
    def tells_orientation(self) -> bool:
        """Whether an image tells which way round the board is; calibrations of poses need that."""

    @abstractmethod
    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        """The corners in an (H, W, 3) image; None if there are fewer than six, or all on one line."""


@dataclass(frozen=True)
class CharucoBoard(Board):
    """A chessboard with ArUco markers of ``marker`` metres in its white squares; it may be partly hidden.

    ``dictionary``: of OpenCV, for example DICT_4X4_50. Raises CalibrationError for boards that cannot be.

    Garrido-Jurado et al., "Automatic generation and detection of highly reliable fiducial markers under occlusion",
    Pattern Recognition 2014.
    """

    columns: int
    rows: int
    square: float
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
    def size(self) -> tuple[float, float]:
        """Extents (x, y) of the pattern, metres."""
        return self.columns * self.square, self.rows * self.square

    @property
    def corner_count(self) -> int:
        """How many corners a complete sighting has."""
        return (self.columns - 1) * (self.rows - 1)

    @property
    def tells_orientation(self) -> bool:
        """The markers tell."""
        return True

    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        """The corners in an (H, W, 3) image; None if there are fewer than six, or all on one line."""
        corners, ids, _, _ = self._detector.detectBoard(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY))
        if corners is None or ids is None:
            return None
        order = np.argsort(ids.ravel())
        points = np.asarray(self._board.getChessboardCorners(), dtype=float)[ids.ravel()[order]]
        return _sighting(points, np.asarray(corners, dtype=float).reshape(-1, 2)[order])

    def picture(self, pixels_per_square: int) -> NDArray[np.uint8]:
        """The pattern, (rows * n, columns * n) uint8, to print or to draw; x along the columns, y along the rows."""
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
    """A plain chessboard, seen as a whole; good for intrinsics, not for poses: half a turn looks the same.

    Duda & Frese, "Accurate detection and localization of checkerboard corners for calibration", BMVC 2018.
    """

    columns: int
    rows: int
    square: float

    def __post_init__(self) -> None:
        if min(self.columns, self.rows) < 4 or not self.square > 0.0:
            raise CalibrationError(f"a checkerboard has at least 4 × 4 squares of positive size, not {self}")

    @property
    def size(self) -> tuple[float, float]:
        """Extents (x, y) of the pattern, metres."""
        return self.columns * self.square, self.rows * self.square

    @property
    def corner_count(self) -> int:
        """How many corners a complete sighting has."""
        return (self.columns - 1) * (self.rows - 1)

    @property
    def tells_orientation(self) -> bool:
        """Half a turn looks the same."""
        return False

    def find(self, rgb: NDArray[np.uint8]) -> BoardSighting | None:
        """All corners in an (H, W, 3) image; None if one of them is missing."""
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
