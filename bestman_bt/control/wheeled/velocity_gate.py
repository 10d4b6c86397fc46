"""The gate for every velocity of a wheeled base: its limits, people's right of way, the collision monitor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor, MonitoredCommand
from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.braking import GiveWay
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from hal.api import MobileBase

STANDING = 0.02
"""Speeds, m/s and rad/s, below which the wheels count as at rest."""
REST = 0.05
"""Fraction of a velocity below which the base stops instead of continuing."""
ON_IT, BESIDE_IT = 0.10, 0.15
"""Metres from a mapped outline within which a hit belongs to it, and beyond which it is an unmapped obstacle."""
RISE = 1.0
"""Largest increase per second of the velocity fraction that people allow, which limits the acceleration."""


class VelocityGate:
    """Commands one base within its safety limits. ``waits``: whether it is stopped for a limit or for people.

    ``held_by``: why the last command was stopped or slowed down, as text. ``placed``: whether the base's pose on the
    map is known; otherwise every obstacle may be tall, and the map is not used.
    """

    def __init__(self, base: MobileBase, monitor: CollisionMonitor) -> None:
        self._base, self._monitor = base, monitor
        self._known: Costmap | None = None
        self.use_footprint(Footprint.of(base.model))
        self._share = 1.0
        self.waits = False
        self.held_by = ""
        self.placed = True

    def use_footprint(self, footprint: Footprint, known: Costmap | None = None) -> None:
        """Set the footprint to protect, arm overhang included; people count as high as the overhang.

        ``known``: mapped obstacles with their heights: tall and unmapped ones are kept from the arm, and those that no
        lidar sees from the upper body.
        """
        self._known = known
        self.outline = FootprintMotion(footprint.corners, 0.0)
        self._give_way = GiveWay(footprint.above)
        self._monitor.use_footprint(footprint)

    def observe(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Pass a new scan to the monitor; ``odometry``: pose in the ``odom`` frame."""
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
        """Command the admissible part of ``twist`` for ``period`` seconds.

        ``most``: m/s, None for the base's own. ``velocity``: measured, in the base frame. ``pose``: in the frame of
        ``people``, who have the right of way, and of ``tall`` obstacles, which are also kept from the arm.
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
        base_from_map = pose.inverse()
        discs = np.array([(disc.x, disc.y, disc.radius) for disc in tall]).reshape(-1, 3)
        discs[:, :2] = base_from_map.apply(discs[:, :2])
        known = self._known
        are_tall = None if known is None else (lambda points: _tall(known, pose.apply(points), self.placed))
        mapped = () if known is None or not self.placed else known.unseen
        unseen = [replace(one, corners=base_from_map.apply(one.corners)) for one in mapped]
        monitored = self._monitor.limit(wanted, velocity, odometry, discs, are_tall, unseen, period)
        self.held_by = monitored.text or _words(velocity)
        if monitored.brake:
            self._base.stop()
        else:
            self._base.set_velocity(monitored.twist.vx, monitored.twist.vy, monitored.twist.wz)
        return monitored


def _tall(known: Costmap, points: NDArray[np.float64], placed: bool) -> NDArray[np.bool_]:
    """Return which lidar hits (N, 2), map frame, reach up to the arm; mapped furniture may be lower."""
    if known.above is None or not placed:
        return np.full(len(points), known.above is not None)
    tall: NDArray[np.bool_] = (known.above.distance_at(points) < ON_IT) | (known.distance_at(points) > BESIDE_IT)
    return tall


def _part(limit: float, value: float) -> float:
    return limit / abs(value) if abs(value) > limit else 1.0


def _words(velocity: Twist2D) -> str:
    if max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) < STANDING:
        return "its wheels do not turn as they should"
    return "its wheels turn, but it does not move"
