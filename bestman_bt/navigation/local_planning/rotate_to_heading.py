"""Turning in place to a heading, on a trapezoidal velocity profile."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.messages.shapes import NonNegative, NotBelow, Positive, check_bounds
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower

SPACING = 0.05
WINDOW = 40
"""Largest number of points by which the progress may increase at once."""
_BUMP = 0.1
_NEARER = 0.15
"""Length of path that may lead away from the base, for example at a corner that it cuts, metres; and the distance by
which a later strand must be nearer before the base counts as being on it.
"""


def first_nearest(points: NDArray[np.float64], position: NDArray[np.float64], spacing: float) -> int:
    """Return the index of the first of path points (N, 2) that is nearest to ``position`` (2,).

    Points are at most ``spacing`` metres apart. Later strands at the same distance are ignored: a path may return near
    itself.
    """
    distances = np.linalg.norm(points - position, axis=1)
    ahead = max(1, round(_BUMP / spacing))
    first = 0
    while len(later := distances[first + 1 : first + 1 + ahead]) and later.min() < distances[first]:
        first += 1 + int(np.argmin(later))
    nearest = int(np.argmin(distances))
    return nearest if distances[nearest] < distances[first] - _NEARER else first


class PathProgress:
    """The progress on a path of dense ``points`` (N, 2), metres."""

    def __init__(self, corners: NDArray[np.float64]) -> None:
        self._corners = corners
        self._points = densified(corners, SPACING)
        self._left = metres_left(self._points)
        self._at = 0

    @property
    def remaining(self) -> float:
        """Return the metres to the end."""
        return float(self._left[self._at])

    @property
    def ahead(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The remaining points (N, 2), and the metres from each to the end (N,)."""
        return self._points[self._at :], self._left[self._at :]

    def advance(self, position: NDArray[np.float64]) -> None:
        """Update the progress for a base at ``position`` (2,), metres."""
        self._at += first_nearest(self._points[self._at : self._at + WINDOW], position, SPACING)

    def skip(self, count: int) -> None:
        """Advance by ``count`` points."""
        self._at += count

    def beside(self, position: NDArray[np.float64]) -> float:
        """Return the distance between ``position`` (2,) and the current point, metres."""
        return float(np.linalg.norm(self._points[self._at] - position))

    def last(self, length: float) -> NDArray[np.float64]:
        """Return the corners (M, 2) of the last ``length`` metres, their beginning included."""
        begin = int(np.searchsorted(-self._left, -length))
        later = self._corners[metres_left(self._corners) < self._left[begin] - 1e-9]
        return np.vstack([self._points[begin : begin + 1], later])


def metres_left(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the path length from each point (N, 2) to the last one, (N,) metres."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.append(np.cumsum(lengths[::-1])[::-1], 0.0)


def densified(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return the same path with points at most ``spacing`` metres apart."""
    pieces = [points[:1]]
    for start, end in itertools.pairwise(points):
        count = math.ceil(float(np.linalg.norm(end - start)) / spacing)
        pieces.append(start + (np.arange(1, count + 1) / max(count, 1))[:, None] * (end - start))
    return np.vstack(pieces)


@dataclass(eq=False)
class RotateToHeading(PathFollower):
    """Turns to the heading of a path's goal at the current position, and ignores the path's points.

    ``max_speed`` rad/s, ``acceleration`` rad/s² (both ways), ``gain`` 1/s close to the heading.

    ``min_speed``: rad/s, below which friction may hold the wheels. ``tolerance``: radians. ``still``: rad/s below which
    the base counts as at rest. ``slack``: longitudinal drift in metres after which the base is driven back, with
    ``place_gain`` 1/s on the excess and at most ``max_place_speed`` m/s; slipping wheels push a loaded base away.
    """

    max_speed: Annotated[Positive, NotBelow("min_speed"), "rad/s"] = 1.2
    acceleration: Annotated[Positive, "rad/s²"] = 1.5
    gain: Annotated[Positive, "1/s"] = 3.0
    min_speed: Annotated[NonNegative, "rad/s"] = 0.05
    tolerance: Annotated[NonNegative, "rad"] = 0.005
    still: Annotated[Positive, "rad/s"] = 0.03
    slack: Annotated[NonNegative, "m"] = 0.02
    place_gain: Annotated[NonNegative, "1/s"] = 5.0
    max_place_speed: Annotated[NonNegative, "m/s"] = 0.2

    def __post_init__(self) -> None:
        check_bounds(self)
        self._heading: float | None = None
        self._speed = 0.0
        self._place: Pose2D | None = None

    @property
    def turn_rate(self) -> float:
        """The last command, rad/s."""
        return self._speed

    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        """Start turning to ``path.goal.theta``."""
        self.turn_to(path.goal.theta)

    def turn_to(self, heading: float, speed: float = 0.0) -> None:
        """Start turning to ``heading``, radians in the map frame; ``speed``: current rate, rad/s."""
        self._heading = heading
        self._speed = speed
        self._place = None

    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        """Return the next command; ``remaining`` is 0, as no distance is driven. See ``PathFollower.compute``."""
        if self._heading is None:
            raise RuntimeError("RotateToHeading.compute was called before reset")
        self._place = self._place or pose
        error = wrap_angle(self._heading - pose.theta)
        arrived = abs(error) < self.tolerance
        if arrived and abs(velocity.wz) < self.still and abs(self._speed) < self.still:
            self._speed = 0.0
            return FollowerCommand(Twist2D(), True, 0.0)
        sign = math.copysign(1.0, error)
        if abs(error) > math.pi - 0.2 and self._speed:
            sign = math.copysign(1.0, self._speed)  # half a turn away, noise must not change the direction
        speed = max(
            self.min_speed, min(self.max_speed, math.sqrt(self.acceleration * abs(error)), self.gain * abs(error))
        )
        if arrived:
            speed = 0.0
        change = self.acceleration * dt
        self._speed += min(max(sign * speed - self._speed, -change), change)
        return FollowerCommand(Twist2D(vx=self._back_to_place(pose), wz=self._speed), False, 0.0)

    def _back_to_place(self, pose: Pose2D) -> float:
        """Return the speed along the base, m/s, that corrects drift; 0 within the slack."""
        assert self._place is not None
        ahead = (pose.inverse() @ self._place).x
        beyond = math.copysign(max(0.0, abs(ahead) - self.slack), ahead)
        return min(max(self.place_gain * beyond, -self.max_place_speed), self.max_place_speed)
