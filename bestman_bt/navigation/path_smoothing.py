"""Smoothing of planned paths, as nav2's simple smoother: each point is drawn to where it was and to its neighbours.

The update is that of S. Thrun's lecture on path smoothing ("Artificial Intelligence for Robotics", 2012), a gradient
descent on the sum of both squared distances. Where the driving direction changes, a path keeps its cusp.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Path2D
from bestman_bt.messages.bounds import Count, NonNegative, Positive, WholeNumber
from bestman_bt.navigation.local_planning.path_progress import densified
from bestman_bt.navigation.path_pieces import joined


@dataclass(frozen=True)
class PathSmoother:
    """Rounds the corners of paths; deterministic.

    ``spacing``: metres between points. ``data_weight``, ``smooth_weight``: of the two pulls.

    ``tolerance``: metres that all points together move in the last step, ``max_iterations``: steps at most.
    ``refinements``: how often the result is smoothed again.
    """

    spacing: Positive = 0.05
    data_weight: Positive = 0.2
    smooth_weight: NonNegative = 0.3
    tolerance: NonNegative = 1e-6
    max_iterations: Count = 1000
    refinements: WholeNumber = 2

    def smooth(self, path: Path2D) -> Path2D:
        """The smoothed path, which keeps its first and its last point and its cusps."""
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
        """One descent from ``points`` (N, 2)."""
        smoothed = points.copy()
        for _ in range(self.max_iterations):
            data = points[1:-1] - smoothed[1:-1]
            bend = smoothed[:-2] + smoothed[2:] - 2.0 * smoothed[1:-1]
            step = self.data_weight * data + self.smooth_weight * bend
            smoothed[1:-1] += step
            if float(np.abs(step).sum()) < self.tolerance:
                break
        return smoothed
