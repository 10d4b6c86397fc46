"""Operations on planar paths: the remaining part, the part before the goal, concatenation."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Path2D, Pose2D, wrap_angle
from bestman_bt.messages.shapes import Count, NonNegative, NonNegativeInt, Positive
from bestman_bt.navigation.local_planning.rotate_to_heading import densified


def metres_along(path: Path2D) -> NDArray[np.float64]:
    """Return the path length up to each point, (N,) metres."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path.points, axis=0), axis=1)))


def nearest_along(path: Path2D, position: NDArray[np.float64], begin: float = 0.0, end: float = math.inf) -> float:
    """Return the metres along a path to its point nearest to ``position`` (2,).

    The path has two points or more; only ``begin`` to ``end`` metres along it are searched, because it may pass a place
    twice.
    """
    along = metres_along(path)
    lengths = np.maximum(np.diff(along), 1e-12)
    steps = np.diff(path.points, axis=0)
    share = np.sum((position - path.points[:-1]) * steps, axis=1) / lengths**2
    low, high = (np.clip((bound - along[:-1]) / lengths, 0.0, 1.0) for bound in (begin, end))
    share = np.clip(share, low, high)
    away = np.linalg.norm(path.points[:-1] + share[:, None] * steps - position, axis=1)
    looked_at = (along[1:] >= begin) & (along[:-1] <= end)
    nearest = int(np.argmin(np.where(looked_at, away, np.inf)))
    return float(along[nearest] + share[nearest] * lengths[nearest])


def piece(path: Path2D, begin: float, end: float) -> Path2D:
    """Return the part between ``begin`` and ``end`` metres along a path with two points or more.

    It keeps the goal if it reaches the path's end; otherwise it ends in the direction of travel.
    """
    along = metres_along(path)
    begin, end = max(0.0, begin), min(float(along[-1]), end)
    begin = min(begin, end)
    inner = np.flatnonzero((along > begin + 1e-9) & (along < end - 1e-9))
    points = np.vstack([_place(path, along, begin), path.points[inner], _place(path, along, end)])
    first = int(np.clip(np.searchsorted(along, begin + 1e-9) - 1, 0, len(path.reverse) - 1))
    reverse = np.append(path.reverse[first], path.reverse[inner])
    if end >= along[-1] - 1e-9:
        return Path2D(points, path.goal, reverse)
    return Path2D(points, _heading_along(points[-2:], bool(reverse[-1])), reverse)


def before_goal(path: Path2D, distance: float) -> Path2D:
    """Return a path with two points or more up to the last point ``distance`` metres (Euclidean) from its end.

    It ends facing the goal; if the whole path is nearer, only its beginning remains.
    """
    along, goal = metres_along(path), path.points[-1]
    end = 0.0
    for i in range(len(path.points) - 2, -1, -1):
        if np.linalg.norm(path.points[i] - goal) >= distance:
            start, step = path.points[i] - goal, path.points[i + 1] - path.points[i]
            # |start + share * step| = distance, the later of the two
            a, b, c = float(step @ step), float(start @ step), float(start @ start) - distance**2
            share = (-b - math.sqrt(max(0.0, b * b - a * c))) / a
            end = float(along[i]) + min(max(share, 0.0), 1.0) * math.sqrt(a)
            break
    cut = piece(path, 0.0, end)
    x, y = cut.points[-1]
    away = goal - cut.points[-1]
    heading = math.atan2(away[1], away[0]) if np.any(away) else path.goal.theta
    if len(cut.reverse) and cut.reverse[-1]:
        heading += math.pi
    return replace(cut, goal=Pose2D(float(x), float(y), wrap_angle(heading)))


def joined(paths: Sequence[Path2D]) -> Path2D:
    """Return the concatenation of paths, each of which begins where the previous one ends."""
    points = np.vstack([paths[0].points, *(path.points[1:] for path in paths[1:])])
    return Path2D(points, paths[-1].goal, np.concatenate([path.reverse for path in paths]))


def _place(path: Path2D, along: NDArray[np.float64], metres: float) -> NDArray[np.float64]:
    return np.array([np.interp(metres, along, path.points[:, k]) for k in range(2)])


def _heading_along(points: NDArray[np.float64], reverse: bool) -> Pose2D:
    (x, y), (dx, dy) = points[-1], points[-1] - points[0]
    return Pose2D(float(x), float(y), wrap_angle(math.atan2(dy, dx) + (math.pi if reverse else 0.0)))


# Smoothing of planned paths, as nav2's simple smoother: each point is drawn to where it was and to its neighbours.
# The update is that of S. Thrun's lecture on path smoothing ("Artificial Intelligence for Robotics", 2012), a gradient
# descent on the sum of both squared distances. Where the driving direction changes, a path keeps its cusp.


@dataclass(frozen=True)
class PathSmoother:
    """Rounds the corners of paths; deterministic.

    ``spacing``: metres between points. ``data_weight``, ``smooth_weight``: weights of fidelity and smoothness.

    ``tolerance``: metres, total motion of all points in the last step, ``max_iterations``: largest number of steps.
    ``refinements``: number of times the result is smoothed again.
    """

    spacing: Positive = 0.05
    data_weight: Positive = 0.2
    smooth_weight: NonNegative = 0.3
    tolerance: NonNegative = 1e-6
    max_iterations: Count = 1000
    refinements: NonNegativeInt = 2

    def smooth(self, path: Path2D) -> Path2D:
        """Return the smoothed path, which keeps its first and its last point and its cusps."""
        if len(path.points) < 3:
            return path
        bounds = [0, *(np.flatnonzero(np.diff(path.reverse)) + 1).tolist(), len(path.points) - 1]
        legs = []
        for first, last in itertools.pairwise(bounds):
            points = densified(path.points[first : last + 1], self.spacing)
            for _ in range(1 + self.refinements):
                points = self._once(points)
            reverse = np.full(len(points) - 1, path.reverse[first])
            legs.append(Path2D(points, path.goal, reverse))
        return joined(legs)

    def _once(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Run one descent from ``points`` (N, 2)."""
        smoothed = points.copy()
        for _ in range(self.max_iterations):
            data = points[1:-1] - smoothed[1:-1]
            bend = smoothed[:-2] + smoothed[2:] - 2.0 * smoothed[1:-1]
            step = self.data_weight * data + self.smooth_weight * bend
            smoothed[1:-1] += step
            if float(np.abs(step).sum()) < self.tolerance:
                break
        return smoothed
