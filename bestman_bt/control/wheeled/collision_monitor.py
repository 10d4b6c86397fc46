"""The last word before the wheels: as nav2's collision monitor, it knows neither path nor map nor planner.

It holds what the lidar sees and what the bumper feels against the motion that is commanded, with the exact footprint:
a command goes through as it is, slowed down so far that the base stops before it touches anything ("approach"), or not
at all. A slow approach to a table is let through up to a finger's breadth; moving away is always free.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose2D, Twist2D
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.braking import braking_time, safe_share
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.robot_model.model import BaseModel
from hal.api import Bumper

STANDING = 0.02
"""m/s and rad/s below which a base has nothing to brake."""
CREEP = 0.005
"""m/s and rad/s below which going on is not worth it."""
BEFORE = 0.15
"""Metres around the disc that stands for a person within which hits are that person's."""
EDGE = 0.03
"""Metres beyond the shortest range within which noise may hide a hit already."""
NEAR = 1.0
"""Metres beyond an arm within which it is asked how tall things are."""
MEMORY = 30.0
"""Seconds after which what is too close to be seen is forgotten: who walked past would block the base for ever."""
NOBODY: NDArray[np.float64] = np.zeros((0, 3))


class MonitorAction(Enum):
    """What became of a command."""

    NONE = "none"
    SLOWDOWN = "slowdown"  # the speed is limited, as something is close
    APPROACH = "approach"  # slowed down so far that the base stops in time
    STOP = "stop"  # nothing is let through
    BUMPED = "bumped"  # nor that, as the bumper is pressed there


@dataclass(frozen=True)
class MonitoredCommand:
    """``twist``: what may be driven. ``brake``: whether the base must stop as hard as it can. ``text``: why."""

    twist: Twist2D
    action: MonitorAction
    brake: bool = False
    text: str = ""


@dataclass(eq=False)
class CollisionMonitor:
    """One base's monitor: ``observe`` each scan, ask ``limit`` before each command.

    Lengths in metres, times in seconds, speeds in m/s.

    ``margin``: kept around the outline. ``same_surface``: neighbouring beams that differ by less are averaged, as the
    nearest of many noisy hits is nearer than what they hit. ``reaction``: from a scan to the brakes.
    ``slowdown_margin``: around the outline; what comes that near within ``slowdown_time`` limits the speed to
    ``slowdown_speed`` (0: no such zone).
    ``frozen_scans``: equal scans in a row after which the lidar is taken for broken, and nothing moves any more.
    ``enabled``: False lets everything through, for experiments.
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
        self._motion = self._above = FootprintMotion(footprint, self.margin)
        self._overhang: FootprintMotion | None = None
        self._wide = FootprintMotion(footprint, self.slowdown_margin)
        self._points = NearPoints(self.same_surface)
        self._stamp, self._equal = -math.inf, 0
        self._high: NDArray[np.intp] = np.zeros(0, dtype=np.intp)

    def use_footprint(self, footprint: Footprint) -> None:
        """What is driven from now on: an arm that stands out above is kept away from people and tall obstacles."""
        self._above = FootprintMotion(footprint.above, self.margin)
        # Its outline has a margin of its own, for how the arm sways.
        self._overhang = None if footprint.overhang is None else FootprintMotion(footprint.above, 0.0)

    def observe(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Take in a scan, taken where the odometry is ``odometry``."""
        self._equal = self._equal + 1 if scan.stamp == self._stamp else 0
        self._stamp = scan.stamp
        self._points.update(scan, base_from_lidar, odometry)

    def limit(
        self,
        wanted: Twist2D,
        velocity: Twist2D,
        odometry: Pose2D,
        tall: NDArray[np.float64] = NOBODY,
        are_tall: Callable[[NDArray[np.float64]], NDArray[np.bool_]] | None = None,
    ) -> MonitoredCommand:
        """What of ``wanted`` may be driven by a base that moves at ``velocity`` (measured), both in the base frame.

        ``tall``: (N, 3) discs around people, x, y and radius in metres, in the base frame. ``are_tall``: which points
        (N, 2) of the base frame are of what reaches up to the arm; None: unknown, and only people are.
        """
        if not self.enabled:
            return MonitoredCommand(wanted, MonitorAction.NONE)
        if self._equal >= self.frozen_scans:
            text = "the lidar tells the same scan again and again"
            return MonitoredCommand(Twist2D(), MonitorAction.STOP, True, text)
        pressed = self._pressed(odometry)
        points = self._points.around(odometry)
        self._high = np.zeros(0, dtype=np.intp)
        if self._overhang is not None and are_tall is not None:
            near = np.flatnonzero(np.hypot(points[:, 0], points[:, 1]) < self._overhang.reach + NEAR)
            self._high = near[are_tall(points[near])]
        people = _within(points, tall)
        moving = max(math.hypot(velocity.vx, velocity.vy), abs(velocity.wz)) > STANDING
        if moving:
            # What the base does now may differ from what is wanted next: it must be able to stop out of that, too.
            time, index, share = self._contact(points, people, velocity)
            if share < 1.0 and time < self.reaction + self._braking(velocity) / 4.0:
                return MonitoredCommand(Twist2D(), MonitorAction.STOP, True, self._words(points[index], "is too close"))
        time, index, share = self._contact(points, people, wanted)
        if pressed is not None and time == 0.0:
            return MonitoredCommand(
                Twist2D(), MonitorAction.BUMPED, True, self._words(pressed, "presses on the bumper")
            )
        if share < 1.0 and share * max(math.hypot(wanted.vx, wanted.vy), abs(wanted.wz)) < CREEP:
            text = self._words(points[index], "is in the way")
            return MonitoredCommand(Twist2D(), MonitorAction.STOP, False, text)
        if share < 1.0:
            text = self._words(points[index], "slows it down")
            return MonitoredCommand(_scaled(wanted, share), MonitorAction.APPROACH, False, text)
        return self._slowed(points, wanted)

    def _slowed(self, points: NDArray[np.float64], wanted: Twist2D) -> MonitoredCommand:
        speed = math.hypot(wanted.vx, wanted.vy)
        if self.slowdown_margin > 0.0 and speed > self.slowdown_speed:
            time, index = self._wide.contact(points, wanted, self.slowdown_time)
            if math.isfinite(time):
                text = self._words(points[index], "is close")
                return MonitoredCommand(
                    _scaled(wanted, self.slowdown_speed / speed), MonitorAction.SLOWDOWN, False, text
                )
        return MonitoredCommand(wanted, MonitorAction.NONE)

    def _contact(
        self, points: NDArray[np.float64], people: NDArray[np.intp], twist: Twist2D
    ) -> tuple[float, int, float]:
        """Seconds until a twist touches something, which point that is, and the share of it that stops in time."""
        reaction, braking = self.reaction, self._braking(twist)
        horizon = reaction + braking / 2.0 + 0.05
        time, index = self._motion.contact(points, twist, horizon)
        if len(people):
            sooner, person = self._above.contact(points[people], twist, horizon)
            if sooner < time:
                time, index = sooner, int(people[person])
        if len(self._high) and self._overhang is not None:
            sooner, high = self._overhang.contact(points[self._high], twist, horizon)
            if sooner < time:
                time, index = sooner, int(self._high[high])
        return time, index, safe_share(time, reaction, braking)

    def _braking(self, twist: Twist2D) -> float:
        limits = self.base.part
        return braking_time(twist, limits.max_acceleration, limits.max_angular_acceleration)

    def _pressed(self, odometry: Pose2D) -> NDArray[np.float64] | None:
        """Where the bumpers are pressed in the mean, (2,) in the base frame; it is remembered like what was seen."""
        places = [bumper.zones[z].middle for bumper in self.bumpers for z in bumper.read().pressed]
        if not places:
            return None
        pressed = np.array(places)
        self._points.note(pressed, odometry, self._stamp)
        mean: NDArray[np.float64] = pressed.mean(axis=0)
        return mean

    def _words(self, point: NDArray[np.float64], what: str) -> str:
        gap = max(0.0, float(self._motion.distance(point)) + self.margin)
        return f"something {100 * gap:.0f} cm {_side(point)} {what}"


def _within(points: NDArray[np.float64], discs: NDArray[np.float64]) -> NDArray[np.intp]:
    """Which points (N, 2) lie within, or right before, one of ``discs`` (M, 3)."""
    if not len(discs):
        return np.zeros(0, dtype=np.intp)
    away = np.linalg.norm(points[:, None] - discs[None, :, :2], axis=-1) - discs[:, 2]
    return np.flatnonzero((away < BEFORE).any(axis=1))


def _side(point: NDArray[np.float64]) -> str:
    """Where a point (2,) of the base frame lies, in words."""
    eighth = round(math.atan2(point[1], point[0]) / (math.pi / 4)) % 8
    return ("ahead", "ahead on the left", "on the left", "behind on the left", "behind", "behind on the right",
            "on the right", "ahead on the right")[eighth]  # fmt: skip


def _scaled(twist: Twist2D, share: float) -> Twist2D:
    return Twist2D(share * twist.vx, share * twist.vy, share * twist.wz)


class NearPoints:
    """Hits in the odometry frame: those of the last scan, and of the blind zone the latest for each degree of bearing.

    ``same_surface``: metres; neighbouring beams that differ by less are averaged.
    """

    def __init__(self, same_surface: float) -> None:
        self._same_surface = same_surface
        self._seen: NDArray[np.float64] = np.zeros((0, 2))
        self._blind: NDArray[np.float64] = np.zeros((0, 3))  # x, y, stamp
        self._stamp = 0.0

    def update(self, scan: LaserScan, base_from_lidar: Pose2D, odometry: Pose2D) -> None:
        """Take in a scan that was taken at ``odometry``."""
        lidar = odometry @ base_from_lidar
        before = np.vstack([self._blind, np.column_stack([self._seen, np.full(len(self._seen), self._stamp)])])
        self._blind = self._still_hidden(before, scan, lidar)
        hit = np.isfinite(scan.ranges)
        ranges, angles = _smoothed(scan.ranges, self._same_surface)[hit], scan.angles[hit]
        self._seen = lidar.apply(np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)]))
        self._stamp = scan.stamp

    def note(self, points: NDArray[np.float64], odometry: Pose2D, stamp: float) -> None:
        """Remember points (N, 2) of the base frame that were felt."""
        felt = np.column_stack([odometry.apply(points), np.full(len(points), stamp)])
        self._blind = np.vstack([self._blind, felt])

    def around(self, odometry: Pose2D) -> NDArray[np.float64]:
        """Return all points (N, 2), metres, in the frame of a base at ``odometry``."""
        return odometry.inverse().apply(np.vstack([self._seen, self._blind[:, :2]]))

    def _still_hidden(self, points: NDArray[np.float64], scan: LaserScan, lidar: Pose2D) -> NDArray[np.float64]:
        """Of points (N, 3) those that the scan could not see, one for each beam: the latest."""
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
