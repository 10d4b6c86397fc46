"""Noticing that a base does not get on."""

from __future__ import annotations

from bestman_bt.messages import Pose2D, wrap_angle


class ProgressWatch:
    """As nav2's progress checker: within ``time`` seconds a base should move ``distance`` metres or turn ``angle``."""

    def __init__(self, distance: float, angle: float, time: float) -> None:
        self._distance, self._angle, self._time = distance, angle, time
        self._pose: Pose2D | None = None
        self._since = 0.0
        self.without = 0.0
        """Seconds without progress, as of the last pose."""

    def restart(self) -> None:
        """The time that has passed does not count: the base was not to move."""
        self._pose = None

    def is_stuck(self, pose: Pose2D, now: float) -> bool:
        """Take in where the base is at ``now`` seconds."""
        moved = self._pose is None or pose.distance_to(self._pose) > self._distance
        if self._pose is None or moved or abs(wrap_angle(pose.theta - self._pose.theta)) > self._angle:
            self._pose, self._since = pose, now
        self.without = now - self._since
        return self.without > self._time
