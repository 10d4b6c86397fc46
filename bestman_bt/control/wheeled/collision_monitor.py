"""Collision monitor: limits each velocity command just before the wheels, independent of path and planner, as Nav2's
does.

It checks the commanded motion of the exact footprint against lidar hits and bumper contacts, and the motion of parts
above the lidar against mapped obstacles that the lidar cannot see, such as a table top. A command is passed unchanged,
slowed down so that the base stops before contact ("approach"), or blocked. A slow approach to a table is allowed up to
about a centimetre; moving away is always allowed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint, points_along
from bestman_bt.navigation.global_planning.layers import UnseenOutline
from bestman_bt.navigation.local_planning.braking import braking_time, safe_share
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion, entry
from bestman_bt.robot_model.model import BaseModel
from hal.api import Bumper

STANDING = 0.02
"""Speed in m/s and rad/s below which a base counts as at rest."""
CREEP = 0.005
"""Speeds, m/s and rad/s, below which a command is blocked instead of slowed down."""
BEFORE = 0.15
"""Metres around a person's disc within which hits belong to that person."""
EDGE = 0.03
"""Metres beyond the minimum range within which noise may hide a hit."""
NEAR = 1.0
"""Metres around an arm within which the heights of obstacles are checked."""
MEMORY = 30.0
"""Seconds for which points too close to be seen are remembered, so that a passing person does not block the base
permanently.
"""
NOTHING: NDArray[np.float64] = np.zeros((0, 3))
SPACING = 0.01
"""Spacing of outline points compared with the map, metres: less than the thickness of any board or handle."""


_Look = tuple[FootprintMotion, NDArray[np.float64]]
"""A moving outline, and the points (N, 2), base frame, that it must not touch."""
_Entry = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Points (N, 2) of a moving outline, and the corners (M, 2) of an area that they must not enter."""


class MonitorAction(Enum):
    """The action of the monitor on a command."""

    NONE = "none"
    SLOWDOWN = "slowdown"  # the speed is limited, as something is close
    APPROACH = "approach"  # slowed down so far that the base stops in time
    STOP = "stop"  # nothing is let through
    BUMPED = "bumped"  # nor that, as the bumper is pressed there


@dataclass(frozen=True)
class MonitoredCommand:
    """A checked command. ``twist``: the allowed velocity. ``brake``: whether the base must stop as hard as it can.
    ``text``: the reason.
    """

    twist: Twist2D
    action: MonitorAction
    brake: bool = False
    text: str = ""


@dataclass(eq=False)
class CollisionMonitor:
    """The collision monitor of a base: ``observe`` each scan, call ``limit`` before each command.

    Lengths in metres, times in seconds, speeds in m/s.

    ``margin``: kept around the outline. ``same_surface``: neighbouring beams that differ by less are averaged, because
    the nearest of many noisy hits is too near. ``reaction``: delay from a scan to the brakes. ``slowdown_margin``: zone
    around the outline; obstacles that would enter it within ``slowdown_time`` limit the speed to ``slowdown_speed`` (0:
    no such zone). ``frozen_scans``: number of equal scans in a row after which the lidar counts as broken and motion is
    stopped. ``enabled``: False disables the monitor, for experiments.
    """

    base: BaseModel
    bumpers: Sequence[Bumper] = ()
    margin: float = 0.015
    same_surface: float = 0.04
    reaction: float = 0.15
    slowdown_margin: float = 0.0
    slowdown_time: float = 1.0
    slowdown_speed: float = 0.2
    frozen_scans: int = 5
    enabled: bool = True

    def __post_init__(self) -> None:
        footprint = Footprint.of(self.base)
        self._motion = FootprintMotion(footprint.corners, self.margin)
        self._wide = FootprintMotion(footprint.corners, self.slowdown_margin)
        self._points = NearPoints(self.same_surface)
        self._stamp, self._equal = -math.inf, 0
        limits = self.base.part
        self._rates = np.array([limits.max_acceleration, limits.max_acceleration, limits.max_angular_acceleration])
        self.use_footprint(footprint)

    def use_footprint(self, footprint: Footprint) -> None:
        """Set the footprint: a protruding arm is kept away from people and tall obstacles.

        The upper body is kept away from obstacles that the lidar cannot see.
        """
        self._expected: NDArray[np.float64] | None = None  # velocity after the commands so far; None: the measured one
        overhang, upper = footprint.overhang, footprint.upper
        self._above = FootprintMotion(footprint.above.corners, self.margin)
        # Outlines of what rides above have margins of their own, for how the arm sways.
        self._overhang = None if overhang is None else FootprintMotion(footprint.above.corners, 0.0)
        self._by_height: list[tuple[float, float, NDArray[np.float64]]] = []
        if upper is not None:
            low, high = upper.lidar_height, math.inf if overhang is None else overhang.height
            self._by_height = [
                (-math.inf, low, footprint.outline(SPACING)),
                (low, high, points_along(upper.corners, SPACING)),
                (high, math.inf, footprint.above.outline(SPACING)),
            ]

    def observe(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Process a scan taken at the pose ``odometry`` in the ``odom`` frame."""
        self._equal = self._equal + 1 if scan.stamp == self._stamp else 0
        self._stamp = scan.stamp
        self._points.update(scan, base_from_lidar, odometry)

    def limit(
        self,
        wanted: Twist2D,
        velocity: Twist2D,
        odometry: Pose2D,
        tall: NDArray[np.float64] = NOTHING,
        are_tall: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
        unseen: Sequence[UnseenOutline] = (),
        period: float = 0.025,
    ) -> MonitoredCommand:
        """Return the allowed part of the command ``wanted`` at the measured ``velocity``, both in the base frame.

        ``tall``: (N, 3) discs around people, x, y and radius in metres, in the base frame. ``are_tall``: function that
        returns which points (N, 2) of the base frame belong to obstacles as high as the arm; None: only people count.
        ``unseen``: mapped obstacles that the lidar cannot see, in the base frame. ``period``: seconds until the next
        command.
        """
        if not self.enabled:
            return MonitoredCommand(wanted, MonitorAction.NONE)
        expected = _array(velocity) if self._expected is None else self._expected
        step = self._rates * period
        reachable = np.sign(_array(wanted)) * expected + step
        monitored = self._limited(wanted, velocity, odometry, tall, are_tall, unseen, reachable)
        change = np.clip(_array(monitored.twist) - expected, -step, step)
        self._expected = None if monitored.brake else expected + change
        return monitored

    def _limited(
        self,
        wanted: Twist2D,
        velocity: Twist2D,
        odometry: Pose2D,
        tall: NDArray[np.float64],
        are_tall: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None,
        unseen: Sequence[UnseenOutline],
        reachable: NDArray[np.float64],
    ) -> MonitoredCommand:
        """Return ``limit`` of a base with the speeds ``reachable`` (3,), m/s and rad/s, in the wanted directions in the
        next period.
        """
        if self._equal >= self.frozen_scans:
            text = "the lidar repeats the same scan"
            return MonitoredCommand(Twist2D(), MonitorAction.STOP, True, text)
        pressed = self._pressed(odometry)
        points = self._points.around(odometry)
        entries = [
            (outline, area.corners)
            for area in unseen
            for low, high, outline in self._by_height
            if low <= area.height < high or (area.low and low == -math.inf)
        ]
        looks = self._looks(points, tall, are_tall), entries
        moving = max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) > STANDING
        if moving:
            # What the base does now may differ from what is wanted next: it must be able to stop out of that, too.
            time, what, share = self._contact(looks, velocity)
            if share < 1.0 and time < self.reaction + self._braking(velocity) / 4.0:
                return MonitoredCommand(Twist2D(), MonitorAction.STOP, True, f"{what} is too close")
        time, what, share = self._contact(looks, wanted)
        if pressed is not None and time == 0.0:
            return MonitoredCommand(
                Twist2D(), MonitorAction.BUMPED, True, f"{self._words(pressed)} presses on the bumper"
            )
        if share < 1.0 and share * max(math.hypot(wanted.vx, wanted.vy), abs(wanted.wz)) < CREEP:
            return MonitoredCommand(Twist2D(), MonitorAction.STOP, False, f"{what} is in the way")
        obstacle = self._beside_curve(looks, velocity, wanted)
        share_on_curve = _share_on_curve(wanted, reachable) if obstacle else 1.0
        if share_on_curve < share:
            share, what = share_on_curve, obstacle
        if share < 1.0:
            return MonitoredCommand(_scaled(wanted, share), MonitorAction.APPROACH, False, f"{what} slows it down")
        return self._slowed(points, wanted)

    def _slowed(self, points: NDArray[np.float64], wanted: Twist2D) -> MonitoredCommand:
        speed = math.hypot(wanted.vx, wanted.vy)
        if self.slowdown_margin > 0.0 and speed > self.slowdown_speed:
            time, index = self._wide.contact(points, wanted, self.slowdown_time)
            if math.isfinite(time):
                text = f"{self._words(points[index])} is close"
                return MonitoredCommand(
                    _scaled(wanted, self.slowdown_speed / speed), MonitorAction.SLOWDOWN, False, text
                )
        return MonitoredCommand(wanted, MonitorAction.NONE)

    def _looks(
        self,
        points: NDArray[np.float64],
        tall: NDArray[np.float64],
        are_tall: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None,
    ) -> list[_Look]:
        """Return which outline is checked against which points."""
        looks = [(self._motion, points), (self._above, points[_within(points, tall)])]
        if self._overhang is not None and are_tall is not None:
            near = points[np.hypot(points[:, 0], points[:, 1]) < self._overhang.reach + NEAR]
            looks.append((self._overhang, near[are_tall(near)]))
        return looks

    def _contact(self, looks: tuple[list[_Look], list[_Entry]], twist: Twist2D) -> tuple[float, str, float]:
        """Return the seconds until a twist leads to contact, the obstacle, and the fraction of the twist that stops in
        time.
        """
        reaction, braking = self.reaction, self._braking(twist)
        horizon, time, what = reaction + braking / 2.0 + 0.05, math.inf, ""
        seen, mapped = looks
        for motion, points in seen:
            sooner, index = motion.contact(points, twist, horizon)
            if sooner < time:
                time, what = sooner, self._words(points[index])
        for outline, corners in mapped:
            sooner, index = entry(outline, corners, twist, horizon)
            if sooner < time:
                time, what = sooner, f"furniture of the map {_side(outline[index])}"
        return time, what, safe_share(time, reaction, braking)

    def _beside_curve(self, looks: tuple[list[_Look], list[_Entry]], velocity: Twist2D, wanted: Twist2D) -> str:
        """Return the obstacle that the base could hit by leaving the commanded curve while it accelerates, or "".

        A base reaches its speed of turning sooner than its speed of driving, so at first it turns more than it was
        commanded: an arm ahead of a base that backs away from a wall would swing into it.
        """
        now, then = _array(velocity), _array(wanted)
        most = self._rates * self.reaction
        next_velocity = now + np.clip(then - now, -most, most)
        if next_velocity @ then > 0.999 * np.linalg.norm(next_velocity) * np.linalg.norm(then):
            return ""
        _, obstacle, share = self._contact(looks, Twist2D(*next_velocity.tolist()))
        return obstacle if share < 1.0 else ""

    def _braking(self, twist: Twist2D) -> float:
        limits = self.base.part
        return braking_time(twist, limits.max_acceleration, limits.max_angular_acceleration)

    def _pressed(self, odometry: Pose2D) -> NDArray[np.float64] | None:
        """Return the mean position (2,) of pressed bumpers, base frame; it is kept in memory like seen obstacles."""
        places = [bumper.zones[z].middle for bumper in self.bumpers for z in bumper.read().pressed]
        if not places:
            return None
        pressed = np.array(places)
        self._points.note(pressed, odometry, self._stamp)
        mean: NDArray[np.float64] = pressed.mean(axis=0)
        return mean

    def _words(self, point: NDArray[np.float64]) -> str:
        gap = max(0.0, float(self._motion.distance(point)) + self.margin)
        return f"something {100 * gap:.0f} cm {_side(point)}"


def _within(points: NDArray[np.float64], discs: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return which points (N, 2) lie within, or just in front of, one of ``discs`` (M, 3)."""
    if not len(discs):
        return np.zeros(0, dtype=np.intp)
    away = np.linalg.norm(points[:, None] - discs[None, :, :2], axis=-1) - discs[:, 2]
    return np.flatnonzero((away < BEFORE).any(axis=1))


def _side(point: NDArray[np.float64]) -> str:
    """Return the words for the side on which a point (2,) of the base frame lies."""
    eighth = round(math.atan2(point[1], point[0]) / (math.pi / 4)) % 8
    return ("ahead", "ahead on the left", "on the left", "behind on the left", "behind", "behind on the right",
            "on the right", "ahead on the right")[eighth]  # fmt: skip


def _scaled(twist: Twist2D, share: float) -> Twist2D:
    return Twist2D(share * twist.vx, share * twist.vy, share * twist.wz)


def _array(twist: Twist2D) -> NDArray[np.float64]:
    return np.array([twist.vx, twist.vy, twist.wz])


def _share_on_curve(wanted: Twist2D, reachable: NDArray[np.float64]) -> float:
    """Return the largest fraction of ``wanted`` within the speeds ``reachable`` (3,), so that the curvature stays."""
    speeds = np.abs(_array(wanted))
    commanded = speeds > 0.0
    return float(np.clip((reachable[commanded] / speeds[commanded]).min(initial=1.0), 0.0, 1.0))


class NearPoints:
    """Hits in the odometry frame: those of the last scan, and the latest in the blind zone for each degree of bearing.

    ``same_surface``: metres; neighbouring beams that differ by less are averaged.
    """

    def __init__(self, same_surface: float) -> None:
        self._same_surface = same_surface
        self._seen: NDArray[np.float64] = np.zeros((0, 2))
        self._blind: NDArray[np.float64] = np.zeros((0, 3))  # x, y, stamp
        self._stamp = 0.0

    def update(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Process a scan taken at the pose ``odometry`` in the ``odom`` frame."""
        lidar = odometry @ base_from_lidar
        before = np.vstack([self._blind, np.column_stack([self._seen, np.full(len(self._seen), self._stamp)])])
        self._blind = self._still_hidden(before, scan, lidar)
        hit = np.isfinite(scan.ranges)
        ranges, angles = _smoothed(scan.ranges, self._same_surface)[hit], scan.angles[hit]
        self._seen = lidar.apply(np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)]))
        self._stamp = scan.stamp

    def note(self, points: NDArray[np.float64], odometry: Pose2D, stamp: float) -> None:
        """Store points (N, 2), metres in the base frame, at which the bumper was pressed."""
        felt = np.column_stack([odometry.apply(points), np.full(len(points), stamp)])
        self._blind = np.vstack([self._blind, felt])

    def around(self, odometry: Pose2D) -> NDArray[np.float64]:
        """Return all points (N, 2), metres, in the frame of a base at ``odometry``."""
        return odometry.inverse().apply(np.vstack([self._seen, self._blind[:, :2]]))

    def _still_hidden(self, points: NDArray[np.float64], scan: LaserScan, lidar: Pose2D) -> NDArray[np.float64]:
        """Return, of points (N, 3), those that the scan could not see: the latest one of each beam."""
        own = lidar.inverse().apply(points[:, :2])
        distance = np.hypot(own[:, 0], own[:, 1])
        hidden = (distance < scan.range_min + EDGE) & (scan.stamp - points[:, 2] < MEMORY)
        points, distance, own = points[hidden], distance[hidden], own[hidden]
        turn = (np.arctan2(own[:, 1], own[:, 0]) - scan.angle_min) % (2.0 * np.pi)
        beam = np.round(turn / scan.angle_increment).astype(int)
        covered = beam < len(scan.ranges)
        behind = scan.ranges[np.where(covered, beam, 0)] > distance + EDGE
        gone = covered & behind & (distance > scan.range_min)
        points, beam = points[~gone], beam[~gone]
        newest_first = np.argsort(-points[:, 2], kind="stable")
        _, first = np.unique(beam[newest_first], return_index=True)
        return points[newest_first[np.sort(first)]]


def _smoothed(ranges: NDArray[np.float64], same_surface: float) -> NDArray[np.float64]:
    """Return each range (N,) as the mean of those up to two beams beside it that hit the same surface: edges stay."""
    beside = np.stack([np.roll(ranges, shift) for shift in range(-2, 3)])
    same = np.abs(np.where(np.isfinite(beside), beside, np.inf) - np.where(np.isfinite(ranges), ranges, 0.0))
    weights = (same < same_surface).astype(float)
    total = np.maximum(weights.sum(axis=0), 1.0)
    mean: NDArray[np.float64] = (weights * np.where(weights > 0.0, beside, 0.0)).sum(axis=0) / total
    return mean
