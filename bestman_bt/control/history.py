"""Buffers of recent timed values, to look up the robot's state at the stamp of a delayed image or scan."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Mapping
from typing import Generic, TypeVar

from bestman_bt.errors import RobotError
from bestman_bt.messages import Pose2D, wrap_angle

Value = TypeVar("Value")

BEFORE = 0.5
"""Seconds before the first value for which this value is also valid, because a robot is at rest when it is first
read.
"""


class NotRecordedError(RobotError, LookupError):
    """A value was requested for a time that the history does not cover."""


class History(Generic[Value]):
    """Stamped values, interpolated at a requested time, as in tf2.

    ``duration``: seconds to store. ``hold``: seconds after the newest value for which it is still valid.
    """

    def __init__(
        self, interpolate: Callable[[Value, Value, float], Value], duration: float = 2.0, hold: float = 0.1
    ) -> None:
        self._interpolate, self._duration, self._hold = interpolate, duration, hold
        self._stamps: list[float] = []
        self._values: list[Value] = []

    def __bool__(self) -> bool:
        return bool(self._stamps)

    def clear(self) -> None:
        """Remove all values."""
        self._stamps.clear()
        self._values.clear()

    def add(self, stamp: float, value: Value) -> None:
        """Add the newest value; values with the same or a later stamp (a clock was set back) are replaced."""
        if not self._stamps:
            self._stamps, self._values = [stamp - BEFORE], [value]
        keep = bisect_left(self._stamps, stamp)
        old = max(0, bisect_left(self._stamps, stamp - self._duration) - 1)
        self._stamps = [*self._stamps[old:keep], stamp]
        self._values = [*self._values[old:keep], value]

    def at(self, stamp: float) -> Value:
        """Return the value at a time, seconds. Raises NotRecordedError outside the recorded time."""
        if not self._stamps:
            raise NotRecordedError("nothing is recorded yet")
        first, last = self._stamps[0], self._stamps[-1]
        if not first <= stamp <= last + self._hold:
            early = stamp < first
            distance = first - stamp if early else stamp - last
            raise NotRecordedError(f"{distance:.2f} s {'before the oldest' if early else 'after the newest'} of them")
        if stamp >= last:
            return self._values[-1]
        after = bisect_left(self._stamps, stamp)
        if self._stamps[after] == stamp:
            return self._values[after]
        begin, end = self._stamps[after - 1], self._stamps[after]
        return self._interpolate(self._values[after - 1], self._values[after], (stamp - begin) / (end - begin))


def pose_between(first: Pose2D, second: Pose2D, share: float) -> Pose2D:
    """Return the pose (m, rad) interpolated by ``share``, 0 to 1, rotating the shorter way."""
    turned = wrap_angle(second.theta - first.theta)
    return Pose2D(
        first.x + share * (second.x - first.x),
        first.y + share * (second.y - first.y),
        wrap_angle(first.theta + share * turned),
    )


def positions_between(first: Mapping[str, float], second: Mapping[str, float], share: float) -> Mapping[str, float]:
    """Return joint positions (rad or m, by name) interpolated by ``share``, 0 to 1; missing joints are copied."""
    between = {name: value + share * (second.get(name, value) - value) for name, value in first.items()}
    return {**second, **between}
