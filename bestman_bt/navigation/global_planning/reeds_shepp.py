"""Reeds-Shepp curves: the shortest ways of a car that may drive backwards, from OMPL.

Reeds and Shepp, "Optimal paths for a car that goes both forwards and backwards", Pacific J. of Mathematics 1990.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from ompl import base

from bestman_bt.messages import wrap_angle

_WORLD = 1e4  # metres each way: more than any map


class ReedsShepp:
    """Curves between poses (x, y, theta) with a smallest ``turning_radius``, metres."""

    def __init__(self, turning_radius: float) -> None:
        self._space = base.ReedsSheppStateSpace(turning_radius)
        bounds = base.RealVectorBounds(2)
        bounds.setLow(-_WORLD)
        bounds.setHigh(_WORLD)
        self._space.setBounds(bounds)
        self._from, self._to, self._between = (self._space.allocState() for _ in range(3))

    def length(self, start: NDArray[np.float64], goal: NDArray[np.float64]) -> float:
        """Metres of the shortest curve between two poses (3,)."""
        _set(self._from, start)
        _set(self._to, goal)
        return float(self._space.distance(self._from, self._to))

    def poses(self, start: NDArray[np.float64], goal: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
        """Poses (N, 3) along the shortest curve, at most ``spacing`` metres apart, both ends included."""
        count = max(1, math.ceil(self.length(start, goal) / spacing))
        poses = np.empty((count + 1, 3))
        for index in range(count + 1):
            self._space.interpolate(self._from, self._to, index / count, self._between)
            poses[index] = self._between.getX(), self._between.getY(), self._between.getYaw()
        return poses


def _set(state: base.State, pose: NDArray[np.float64]) -> None:
    state.setX(float(pose[0]))
    state.setY(float(pose[1]))
    # A half turn is out of OMPL's bounds.
    state.setYaw(min(max(float(wrap_angle(pose[2])), -math.pi), math.pi - 1e-12))
