"""Footprints against a distance grid, many poses at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.cost_to_go import DistanceGrid

STEP = 0.02
"""Maximum motion of a point of the outline between two collision checks, metres."""
MOST_STEPS = 60
NEARER = 1e-3


class FootprintMotion:
    """A convex outline, ``corners`` (N, 2) counter-clockwise, with a ``margin`` in metres around it."""

    def __init__(self, corners: NDArray[np.float64], margin: float) -> None:
        edges = np.roll(corners, -1, axis=0) - corners
        self._normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
        self._offsets = np.einsum("ij,ij->i", self._normals, corners) + margin
        self.reach = float(np.linalg.norm(corners, axis=1).max()) + margin
        """Metres from the base's middle within which a point can be within the outline."""

    def distance(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distances (...) of points (..., 2), base frame, to the outline with its margin, metres; exact
        along its edges.

        Negative inside; at a corner it is the smaller distance to the edges' lines.
        """
        distances: NDArray[np.float64] = (points @ self._normals.T - self._offsets).max(axis=-1)
        return distances

    def contact(self, points: NDArray[np.float64], twist: Twist2D, horizon: float) -> tuple[float, int]:
        """Return the seconds, at most ``horizon``, until ``twist`` brings the outline to one of ``points`` (N, 2), and
        its index.

        Infinity and -1 without contact. A point already inside the outline counts only if the motion approaches it.
        """
        speed = math.hypot(twist.vx, twist.vy)
        reach = self.reach + speed * horizon
        near = np.flatnonzero(np.einsum("ij,ij->i", points, points) < reach**2)
        if not len(near) or (speed == 0.0 and twist.wz == 0.0):
            return math.inf, -1
        times = _looks(twist, self.reach, horizon)
        x, y, theta = arc(twist, times)
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        dx, dy = points[near, 0] - x[:, None], points[near, 1] - y[:, None]
        distances = self.distance(np.stack([cos * dx + sin * dy, cos * dy - sin * dx], axis=-1))
        touched = (distances < 0.0) & (distances < distances[0] - NEARER)
        first = int(np.argmax(touched.any(axis=1)))
        if not touched[first].any():
            return math.inf, -1
        index = int(np.argmin(np.where(touched[first], distances[first], np.inf)))
        before, after = float(distances[first - 1, index]), float(distances[first, index])
        share = before / (before - after) if before > 0.0 else 0.0
        time = float(times[first - 1] + share * (times[first] - times[first - 1]))
        return (time if distances[0, index] > 0.0 else 0.0), int(near[index])


def entry(
    outline: NDArray[np.float64], corners: NDArray[np.float64], twist: Twist2D, horizon: float
) -> tuple[float, int]:
    """Return the time, at most ``horizon`` seconds, until ``twist`` moves a point of an outline (N, 2) into an area,
    and the point's index.

    ``corners``: (M, 2) of the convex area in the base frame, counter-clockwise. Infinity and -1 without contact. An
    outline that already overlaps it may move as long as no point gets deeper than the deepest one.
    """
    area, reach = FootprintMotion(corners, 0.0), float(np.linalg.norm(outline, axis=1).max())
    speed = math.hypot(twist.vx, twist.vy)
    if float(area.distance(np.zeros(2))) > reach + speed * horizon or (speed == 0.0 and twist.wz == 0.0):
        return math.inf, -1
    times = _looks(twist, reach, horizon)
    x, y, theta = arc(twist, times)
    cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
    moved_x = x[:, None] + cos * outline[:, 0] - sin * outline[:, 1]
    moved_y = y[:, None] + sin * outline[:, 0] + cos * outline[:, 1]
    distances = area.distance(np.stack([moved_x, moved_y], axis=-1))
    least = distances.min(axis=1)
    within = (least < 0.0) & (least < least[0] - NEARER)
    first = int(np.argmax(within))
    if not within[first]:
        return math.inf, -1
    before, after = float(least[first - 1]), float(least[first])
    share = before / (before - after) if before > 0.0 else 0.0
    time = float(times[first - 1] + share * (times[first] - times[first - 1]))
    return (time if least[0] > 0.0 else 0.0), int(np.argmin(distances[first]))


def _looks(twist: Twist2D, reach: float, horizon: float) -> NDArray[np.float64]:
    """Return the times, seconds, at which to check a twist, such that no point within ``reach`` moves
    far between them.
    """
    way = (math.hypot(twist.vx, twist.vy) + abs(twist.wz) * reach) * horizon
    steps = min(MOST_STEPS, math.ceil(way / STEP))
    return horizon * np.arange(steps + 1) / steps


def arc(
    twist: Twist2D, times: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return x, y, theta (T,) of the base after ``times`` (T,) seconds at ``twist``, in its initial frame."""
    turned = twist.wz * times
    if abs(twist.wz) < 1e-6:
        return twist.vx * times, twist.vy * times, turned
    along, across = np.sin(turned) / twist.wz, (1.0 - np.cos(turned)) / twist.wz
    return twist.vx * along - twist.vy * across, twist.vx * across + twist.vy * along, turned


SPACING = 0.04
"""Spacing of the outline's points, metres; a pointed obstacle may come within half of it undetected."""

Floats = NDArray[np.float32]


class FootprintCheck:
    """Collision checks of base poses: by the outline if the position of its middle is not sufficient.

    The overhang is checked against the grid's ``tall``.
    """

    def __init__(self, footprint: Footprint) -> None:
        self._outline = footprint.outline(SPACING).astype(np.float32)
        self.inner = np.float32(footprint.inscribed_radius)
        self._outer = np.float32(footprint.circumscribed_radius)
        self._above = None if footprint.overhang is None else FootprintCheck(footprint.above)

    def touches(
        self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats, margin: float
    ) -> tuple[NDArray[np.bool_], Floats]:
        """Return for poses of any shape whether an obstacle is within ``margin`` metres, and its distance from the
        middle.
        """
        middle = grid.at(x, y)
        margin32 = np.float32(margin)
        touches = middle < self.inner + margin32
        unsure = np.flatnonzero(~touches & (middle < self._outer + margin32))
        if len(unsure):
            around = self._around(grid, x.ravel()[unsure], y.ravel()[unsure], theta.ravel()[unsure])
            touches.ravel()[unsure] = around < margin32 + np.float32(SPACING / 2)
        if self._above is not None and grid.tall is not None:
            touches |= self._above.touches(grid.tall, x, y, theta, margin)[0]
        return touches, middle

    def clearance(self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats) -> Floats:
        """Return a lower bound of the clearance for poses (N,), metres; negative if they may overlap."""
        around = self._around(grid, x, y, theta) - np.float32(SPACING / 2)
        clearance: Floats = np.minimum(around, grid.at(x, y) - self.inner)
        if self._above is not None and grid.tall is not None:
            clearance = np.minimum(clearance, self._above.clearance(grid.tall, x, y, theta))
        return clearance

    def _around(self, grid: DistanceGrid, x: Floats, y: Floats, theta: Floats) -> Floats:
        cos, sin = np.cos(theta)[:, None], np.sin(theta)[:, None]
        px, py = self._outline.T
        around: Floats = grid.at(x[:, None] + cos * px - sin * py, y[:, None] + sin * px + cos * py).min(axis=1)
        return around
