"""Estimation of the axis of an unknown door or drawer from the path of the hand that holds it.

Line or circle, whichever fits: Sturm, Stachniss and Burgard, "A probabilistic framework for learning kinematic models
of articulated objects", JAIR 2011; the circle by Taubin's algebraic fit (PAMI 1991).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import JointKind

Array = NDArray[np.float64]


@dataclass(frozen=True)
class AxisFitting:
    """Parameters of the fit of an axis to the hand's path. Metres and radians.

    ``spacing``: between two samples of the path. ``bulge``: of the path from its chord, above which a circle is fitted;
    ``hinted_bulge``: the same if a hinge is expected. ``longest_radius``: largest radius of a hinge. ``recent``: length
    of the path's end that gives the direction before a circle is found. ``enough``: length of the path from which the
    estimate replaces the belief.
    """

    spacing: float = 0.002
    bulge: float = 0.0015
    hinted_bulge: float = 0.0008
    longest_radius: float = 1.5
    recent: float = 0.016
    enough: float = 0.12


@dataclass(frozen=True, eq=False)
class JointAxis:
    """The axis of the hand's motion, in the base frame.

    ``point``: (3,) on the axis; ``direction``: (3,) unit, the motion is right-handed about it or along it. ``radius``:
    metres from the axis to the hand, 0 for a line. ``deviation``: RMS error of the path, metres.
    """

    kind: JointKind
    point: Array
    direction: Array
    radius: float
    deviation: float

    def tangent(self, position: Array) -> Array:
        """Return the direction (3,) of motion at ``position``."""
        if self.kind == "prismatic":
            return self.direction
        way = np.cross(self.direction, position - self.point)
        tangent: Array = way / max(float(np.linalg.norm(way)), 1e-9)
        return tangent

    def angle(self, start: Array, position: Array) -> float:
        """Return the rotation from ``start`` to ``position``, (-π, π] rad; 0 for a line."""
        if self.kind == "prismatic":
            return 0.0
        a, b = start - self.point, position - self.point
        return math.atan2(float(np.cross(a, b) @ self.direction), float(a @ b - (a @ self.direction) ** 2))

    def travelled(self, start: Array, position: Array) -> float:
        """Return the distance along the line or arc, metres."""
        if self.kind == "prismatic":
            return float((position - start) @ self.direction)
        return self.radius * self.angle(start, position)


class JointAxisEstimator:
    """Estimates the axis from successive hand positions; ``axis``: the current estimate.

    ``believed``: initial estimate; ``learns``: whether the hand's path refines it.
    """

    def __init__(
        self,
        direction: Array,
        start: Array,
        hint: JointKind | None = None,
        fitting: AxisFitting = AxisFitting(),
        believed: JointAxis | None = None,
        learns: bool = True,
    ) -> None:
        self._fitting = fitting
        self._hint = hint
        self._way = [np.array(start, dtype=float)]
        self._believed, self._learns = believed, learns
        self.axis = believed or JointAxis("prismatic", self._way[0], np.array(direction, dtype=float), 0.0, 0.0)

    def add(self, position: Array) -> None:
        """Add a hand position (3,), metres."""
        if not self._learns or float(np.linalg.norm(position - self._way[-1])) < self._fitting.spacing:
            return
        self._way.append(np.array(position, dtype=float))
        far = float(np.linalg.norm(position - self._way[0])) >= self._fitting.enough
        if len(self._way) >= 5 and (far or self._believed is None):
            self.axis = self._fit(np.array(self._way))

    def _fit(self, way: Array) -> JointAxis:
        p = self._fitting
        centre = way.mean(axis=0)
        _, _, axes = np.linalg.svd(way - centre, full_matrices=False)
        line = self._line(way, centre, axes[0])
        bulge = float(np.ptp((way - centre) @ axes[1]))
        least = p.hinted_bulge if self._hint == "revolute" else p.bulge
        if self._hint == "prismatic" or bulge < least:
            return line
        flat = (way - centre) @ axes[:2].T
        middle, radius = _circle(flat)
        deviation = float(np.sqrt(np.mean((np.linalg.norm(flat - middle, axis=1) - radius) ** 2)))
        if not (np.isfinite(radius) and radius <= p.longest_radius and deviation < line.deviation / 2):
            return line
        point = centre + middle @ axes[:2]
        normal = np.cross(axes[0], axes[1])
        onward = float(np.cross(normal, way[-1] - point) @ (way[-1] - way[-3]))
        return JointAxis("revolute", point, normal if onward >= 0.0 else -normal, radius, deviation)

    def _line(self, way: Array, centre: Array, axis: Array) -> JointAxis:
        across = (way - centre) - np.outer((way - centre) @ axis, axis)
        deviation = float(np.sqrt(np.mean(np.sum(across**2, axis=1))))
        far = np.linalg.norm(way - way[-1], axis=1) >= self._fitting.recent
        since = int(np.flatnonzero(far)[-1]) if np.any(far) else 0
        recent = way[-1] - way[since]
        straight = self._hint == "prismatic" or deviation < 0.0002
        direction = axis if straight else recent / np.linalg.norm(recent)
        direction = direction if float(direction @ (way[-1] - way[0])) >= 0.0 else -direction
        return JointAxis("prismatic", way[0], direction, 0.0, deviation)


def _circle(points: Array) -> tuple[Array, float]:
    """Return centre (2,) and radius of Taubin's circle through (N, 2) points about their mean."""
    square = np.sum(points**2, axis=1)
    mean = float(square.mean())
    scaled = (square - mean) / (2.0 * math.sqrt(mean))
    _, _, rows = np.linalg.svd(np.column_stack([scaled, points]), full_matrices=False)
    a = rows[2, 0] / (2.0 * math.sqrt(mean))
    if abs(a) < 1e-12:
        return np.zeros(2), math.inf
    b, c, d = rows[2, 1], rows[2, 2], -mean * a
    return np.array([-b, -c]) / (2.0 * a), math.sqrt(max(0.0, b * b + c * c - 4.0 * a * d)) / (2.0 * abs(a))
