"""What becomes of a wanted velocity before the wheels turn: limits, giving way to people, the collision monitor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor, MonitoredCommand
from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning import Footprint
from bestman_bt.navigation.local_planning import FootprintMotion, GiveWay, MovingObstacle
from hal.api import MobileBase

STANDING = 0.02
"""m/s and rad/s below which the wheels count as standing."""
REST = 0.05
"""Share of a velocity below which going on is not worth it."""
RISE = 1.0
"""By how much the share that people leave may rise in a second: it is as good as an acceleration."""


class VelocityGate:
    """Commands one base. ``waits``: it stands for a limit or for people.

    ``held_by``: in words, why the base is stopped or slowed down, as of the last command.
    """

    def __init__(self, base: MobileBase, monitor: CollisionMonitor) -> None:
        self._base, self._monitor = base, monitor
        self.use_footprint(Footprint.of(base.model))
        self._share = 1.0
        self.waits = False
        self.held_by = ""

    def use_footprint(self, footprint: Footprint) -> None:
        """What is driven from now on; people are as high as what stands out above it."""
        self.outline = FootprintMotion(footprint, 0.0)
        self._give_way = GiveWay(footprint.above)
        self._monitor.use_footprint(footprint)

    def observe(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """A new scan, for the monitor."""
        self._monitor.observe(scan, base_from_lidar, odometry)

    def command(
        self,
        twist: Twist2D,
        most: float | None,
        velocity: Twist2D,
        pose: Pose2D,
        odometry: Pose2D,
        people: Sequence[MovingObstacle],
        tall: Sequence[MovingObstacle],
        period: float,
    ) -> MonitoredCommand:
        """Have the base drive what of ``twist`` may be driven, for ``period`` seconds.

        ``most``: m/s, None for the base's own. ``velocity``: measured, in the base frame. ``pose``: in the frame of
        ``people``, who walk and are given way, and of all who are ``tall``: they are kept from the arm, too.
        """
        limits = self._base.model.part
        speed = limits.max_vx if most is None else min(limits.max_vx, most)
        # All are scaled alike, so that the curvature stays.
        share = (
            min(1.0, _part(speed, twist.vx), _part(speed, twist.vy), _part(limits.max_wz, twist.wz))
            if speed > 0.0
            else 0.0
        )
        wanted = Twist2D(share * twist.vx, share * twist.vy if limits.max_vy else 0.0, share * twist.wz)
        self._share = min(self._give_way.share(pose, wanted, people), self._share + RISE * period)
        wanted = Twist2D(self._share * wanted.vx, self._share * wanted.vy, self._share * wanted.wz)
        self.waits = speed == 0.0 or self._share < REST
        discs = np.array([(disc.x, disc.y, disc.radius) for disc in tall]).reshape(-1, 3)
        discs[:, :2] = pose.inverse().apply(discs[:, :2])
        monitored = self._monitor.limit(wanted, velocity, odometry, discs)
        self.held_by = monitored.text or _words(velocity)
        if monitored.brake:
            self._base.stop()
        else:
            self._base.set_velocity(monitored.twist.vx, monitored.twist.vy, monitored.twist.wz)
        return monitored


def _part(limit: float, value: float) -> float:
    return limit / abs(value) if abs(value) > limit else 1.0


def _words(velocity: Twist2D) -> str:
    if max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) < STANDING:
        return "its wheels do not turn as they should"
    return "its wheels turn, and it stays where it is"
