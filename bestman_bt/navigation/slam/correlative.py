"""Correlative scan matching with a pyramid of grids: the best pose in a window, independent of the guess.

E. Olson, "Real-time correlative scan matching", 2009; the search is the branch and bound of W. Hess et al., "Real-time
loop closure in 2D lidar SLAM", 2016.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter1d

from bestman_bt.messages import Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count, Fraction, Positive


@dataclass(frozen=True)
class LikelihoodPyramid:
    """Likelihood grids of several resolutions. ``resolution``: metres per cell. ``std``: metres from a point at which a
    hit scores 61 %. ``levels``: number of levels of the pyramid; the coarsest covers 2**(levels - 1) cells.
    ``min_score``: minimum mean score of the hits.
    """

    resolution: Annotated[Positive, "m per cell"] = 0.05
    std: Annotated[Positive, "m"] = 0.06
    levels: Count = 4
    min_score: Fraction = 0.45


@dataclass(frozen=True)
class SearchWindow:
    """A window around a guess, each way: ``distance`` in x and y, metres; ``angle``, radians."""

    distance: float
    angle: float


@dataclass(frozen=True)
class CorrelativeMatch:
    """The result of a match. ``pose``: accurate to a cell and an angle step. ``score``: 0 to 1, mean score of the
    hits.
    """

    pose: Pose2D
    score: float


class CorrelativeMatcher:
    """Searches over one set of reference points, (N, 2) metres."""

    def __init__(self, points: NDArray[np.float64], pyramid: LikelihoodPyramid = LikelihoodPyramid()) -> None:
        self._levels = p = pyramid
        margin = 4.0 * p.std
        self._origin = points.min(axis=0) - margin
        columns, rows = np.ceil((points.max(axis=0) + margin - self._origin) / p.resolution).astype(int) + 1
        empty = np.ones((rows, columns), dtype=bool)
        column, row = ((points - self._origin) / p.resolution).astype(int).T
        empty[row, column] = False
        likelihood = np.exp(-0.5 * (distance_transform_edt(empty) * p.resolution / p.std) ** 2).astype(np.float32)
        # Level k has at each cell the best of the 2**k cells from there on, in x and y; blocks may begin in the border.
        border = 2 ** (p.levels - 1)
        likelihood = np.pad(likelihood, border)
        self._origin = self._origin - border * p.resolution
        self._pyramid = [likelihood]
        for level in range(1, p.levels):
            size = 2**level
            best = maximum_filter1d(likelihood, size, axis=0, origin=-(size // 2), mode="constant")
            self._pyramid.append(maximum_filter1d(best, size, axis=1, origin=-(size // 2), mode="constant"))

    def search(self, hits: NDArray[np.float64], guess: Pose2D, window: SearchWindow) -> CorrelativeMatch | None:
        """Return the pose within ``window`` with the best match of ``hits`` (N, 2), base frame, or None."""
        p = self._levels
        reach = max(1.0, float(np.percentile(np.linalg.norm(hits, axis=1), 90)))
        turns = math.ceil(window.angle * reach / p.resolution)  # steps by which the far hits move one cell
        angles = guess.theta + np.arange(-turns, turns + 1) * (window.angle / max(turns, 1))
        cells = [self._cells(hits, Pose2D(guess.x, guess.y, angle)) for angle in angles]
        half = math.ceil(window.distance / p.resolution)
        level = p.levels - 1
        corners = np.arange(-half, half + 1, 2**level)
        shifts = np.stack(np.meshgrid(corners, corners), axis=-1).reshape(-1, 2)
        # Best first: the bound of a block is no less than any score in it, so the first cell that comes up is the best.
        queue: list[tuple[float, int, int, int, int]] = []
        for turn in range(len(angles)):
            self._push(queue, p.min_score, level, turn, shifts, cells[turn])
        while queue:
            bound, level, turn, dx, dy = heapq.heappop(queue)
            if level == 0:
                pose = Pose2D(guess.x + dx * p.resolution, guess.y + dy * p.resolution, wrap_angle(float(angles[turn])))
                return CorrelativeMatch(pose, -bound)
            step = 2 ** (level - 1)
            children = np.array([(dx, dy), (dx + step, dy), (dx, dy + step), (dx + step, dy + step)])
            children = children[(children <= half).all(axis=1)]
            self._push(queue, p.min_score, level - 1, turn, children, cells[turn])
        return None

    def _push(
        self,
        queue: list[tuple[float, int, int, int, int]],
        least: float,
        level: int,
        turn: int,
        shifts: NDArray[np.intp],
        cells: NDArray[np.intp],
    ) -> None:
        grid = self._pyramid[level]
        shifted = cells[None] + shifts[:, None]
        column, row = shifted[..., 0], shifted[..., 1]
        inside = (column >= 0) & (row >= 0) & (column < grid.shape[1]) & (row < grid.shape[0])
        values = np.where(inside, grid[np.where(inside, row, 0), np.where(inside, column, 0)], 0.0)
        for (dx, dy), score in zip(shifts.tolist(), values.mean(axis=1, dtype=float).tolist(), strict=True):
            if score >= least:
                heapq.heappush(queue, (-score, level, turn, dx, dy))

    def _cells(self, hits: NDArray[np.float64], pose: Pose2D) -> NDArray[np.intp]:
        cells: NDArray[np.intp] = np.floor((pose.apply(hits) - self._origin) / self._levels.resolution).astype(int)
        return cells
