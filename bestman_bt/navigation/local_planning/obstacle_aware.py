"""Base of obstacle-avoiding followers: surroundings, path direction, and driving of the ends.

Tight places at the ends of a path are left and entered as planned: straight, by pure pursuit, to millimetres. In
between a subclass chooses velocities freely. All commands respect the limits of acceleration and jerk, and the speed
from which the base can stop before obstacles.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import LaserScan, Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.messages.shapes import Count, NonNegative, NotBelow, Positive
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.braking import JerkLimit, braking_time, safe_share
from bestman_bt.navigation.local_planning.cost_to_go import CostToGo, cost_to_go
from bestman_bt.navigation.local_planning.critics import Critics, CriticWeights, Surroundings
from bestman_bt.navigation.local_planning.footprint_check import FootprintCheck, FootprintMotion, arc
from bestman_bt.navigation.local_planning.obstacle_layer import LocalObstacles
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.local_planning.rotate_to_heading import PathProgress, RotateToHeading, densified
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.part_config import MobilePart

STILL = 0.02
ARRIVED = 0.15
TURN_ENDS = 0.25
TURN_TRIAL = 0.8
"""Thresholds of turning in place: m/s below which the base counts as at rest; metres from the point to which the field
leads; radians off the path at which a turn ends; rad/s at which it must be free, otherwise the base continues
differently.
"""


@dataclass(eq=False)
class ObstacleAwareFollower(PathFollower):
    """Subclasses choose the velocity in free space: ``begin`` and ``choose``.

    A path without a costmap is followed exactly. Lengths in metres, speeds in m/s, angles in radians, times in seconds.
    ``max_speed``, ``max_turn_rate``: besides the base's own limits. ``margin``: around the outline. ``clearance``:
    added to the inscribed radius for detours (1 cm in narrow places). ``hand_over``: metres before the goal where pure
    pursuit takes over, ``entry``: the part of them that is driven exactly as planned. ``carrot``: distance of the point
    to head for. ``turn_first``: heading error above which a non-holonomic base turns in place. ``reaction``: delay of
    the brakes. ``field_every``: commands after which the field is updated without a scan.
    """

    max_speed: Annotated[Positive, "m/s"] = 0.6
    max_turn_rate: Annotated[Positive, "rad/s"] = 1.2
    margin: Annotated[NonNegative, "m"] = 0.03
    clearance: Annotated[NonNegative, "m"] = 0.05
    hand_over: Annotated[NonNegative, NotBelow("entry"), "m"] = 0.6
    entry: Annotated[NonNegative, "m"] = 0.42
    carrot: Annotated[Positive, "m"] = 0.7
    turn_first: Annotated[NonNegative, "rad"] = 1.0
    reaction: Annotated[NonNegative, "s"] = 0.1
    field_every: Count = 10
    critics: CriticWeights = field(default_factory=CriticWeights)
    obstacles: LocalObstacles = field(default_factory=LocalObstacles)
    ends: PurePursuit = field(default_factory=PurePursuit)
    turning: RotateToHeading = field(default_factory=RotateToHeading)

    def __post_init__(self) -> None:
        self._limits: MobilePart | None = None
        self._progress: PathProgress | None = None
        self._to_go: CostToGo | None = None
        self._driving_exactly = self._all_exactly = self._handing_over = self._turning = False
        self._fresh = False
        self._since_field = 0

    @abstractmethod
    def begin(self, limits: MobilePart, critics: Critics) -> None:
        """Set the base to drive, and how its drives are scored."""

    @abstractmethod
    def restart(self) -> None:
        """Forget the previous choice."""

    @abstractmethod
    def choose(self, pose: Pose2D, twist: Twist2D, around: Surroundings, dt: float) -> Twist2D:
        """Return the target velocity from the current pose and commanded ``twist``; zero if no motion is free."""

    @override
    def configure(self, base: BaseModel) -> None:
        self._limits = limits = base.part.slowed(self.max_speed, self.max_turn_rate)
        self._smooth = JerkLimit(limits)
        self._use_footprint(limits, Footprint.of(base))

    def _use_footprint(self, limits: MobilePart, footprint: Footprint) -> None:
        self._footprint = footprint
        self._motion = FootprintMotion(footprint.corners, self.margin)
        self._check = FootprintCheck(footprint)
        self.begin(limits, Critics(self.critics, footprint, limits.max_vy > 0.0))

    @override
    def observe(self, scan: LaserScan, map_from_lidar: Pose2D) -> None:
        self.obstacles.update(scan, map_from_lidar)
        self._since_field = self.field_every

    @override
    def reset(self, path: Path2D, costmap: Costmap | None = None) -> None:
        if self._limits is None:
            raise RuntimeError(f"{type(self).__name__}.reset was called before configure: it must know its base")
        if len(path.points) == 0:
            raise ValueError(f"{type(self).__name__} path should have at least one point but has none")
        overhang = None if costmap is None else costmap.footprint.overhang
        if overhang is not self._footprint.overhang:
            self._use_footprint(self._limits, replace(self._footprint, overhang=overhang))
        self.obstacles.use_costmap(costmap)
        self._path = path
        self._backwards = int(np.argmin(np.append(path.reverse, False)))  # segments at the start
        self._handing_over = self._turning = False
        self._smooth.reset(Twist2D())
        self._fresh = True
        self._to_go = None  # it led along the path before
        self.restart()
        self._progress = PathProgress(path.points[self._backwards :])
        self._all_exactly = costmap is None or self._progress.remaining <= self.hand_over
        if self._all_exactly:
            self._drive_exactly(path)
        elif self._backwards:
            points = path.points[: self._backwards + 1]
            heading = math.atan2(*(points[-2] - points[-1])[::-1])
            end = Pose2D(float(points[-1, 0]), float(points[-1, 1]), heading)
            self._drive_exactly(Path2D(points, end, path.reverse[: self._backwards]))
        else:
            self._driving_exactly = False

    @override
    def compute(self, pose: Pose2D, velocity: Twist2D, dt: float) -> FollowerCommand:
        if self._progress is None:
            raise RuntimeError(f"{type(self).__name__}.compute was called before reset")
        self.obstacles.centre_on(pose)
        if self._fresh:
            self._fresh = False
            self._smooth.reset(velocity)  # a base that drives goes on from there
        if self._driving_exactly:
            command = self.ends.compute(pose, velocity, dt)
            if not command.done:
                return replace(command, twist=self._scaled(command.twist, self._share_seen(pose, command.twist)))
            if self._handing_over or self._all_exactly:
                return command
            self._driving_exactly = False
        self._progress.advance(pose.xy)
        remaining = self._progress.remaining
        if self._near_the_end(pose):
            twist = self._smooth.towards(Twist2D(), dt)
            if max(abs(twist.vx), abs(twist.vy), abs(twist.wz)) < STILL:
                self._handing_over = True
                self._drive_exactly(self._final_path(pose))
            return FollowerCommand(twist, False, remaining)
        wanted = self._wanted(pose, dt)
        before = self._smooth.twist
        share = min(self._share_around(pose, before), self._share_seen(pose, before))
        if share < 1.0:
            return FollowerCommand(self._smooth.brake(self._scaled(before, share), dt), False, remaining)
        return FollowerCommand(self._smooth.towards(wanted, dt), False, remaining)

    def _wanted(self, pose: Pose2D, dt: float) -> Twist2D:
        """Return the wanted twist: if there is room, turn in place towards a path far to the side; otherwise that of
        the subclass.
        """
        assert self._limits is not None
        to_go = self._field(pose)
        if not to_go.reachable:
            return Twist2D()
        bearing = math.atan2(to_go.carrot[1] - pose.y, to_go.carrot[0] - pose.x)
        off = abs(wrap_angle(bearing - pose.theta))
        if self._limits.max_vy == 0.0 and not self._turning and off > self.turn_first:
            self._turning = True
            self.turning.turn_to(bearing)
        if self._turning and off > TURN_ENDS:
            self.turning.turn_to(bearing, self._smooth.twist.wz)
            turn = self.turning.compute(pose, Twist2D(), dt).twist
            trial = Twist2D(wz=math.copysign(TURN_TRIAL, wrap_angle(bearing - pose.theta)))
            if min(self._share_around(pose, trial), self._share_seen(pose, trial)) == 1.0:
                return turn
        elif self._turning:
            self._turning = False
            self.restart()
        start = np.array([[pose.x], [pose.y], [pose.theta]], dtype=np.float32)
        here = float(self._check.clearance(self.obstacles.distance, *start)[0])
        # Who stands closer to something than the margin must be able to leave.
        margin = min(self.margin, here - 0.01)
        around = Surroundings(self.obstacles.distance, to_go, self.obstacles.moving.obstacles, margin)
        wanted = self.choose(pose, self._smooth.twist, around, dt)
        return self._slow_before_the_end(wanted)

    def _field(self, pose: Pose2D) -> CostToGo:
        assert self._limits is not None
        assert self._progress is not None
        self._since_field += 1
        if self._to_go is None or self._since_field > self.field_every:
            self._since_field = 0
            ahead, left = self._progress.ahead
            footprint, free = self._footprint, self.obstacles.distance
            inscribed = footprint.inscribed_radius
            if free.tall is not None:
                more = np.float32(footprint.above.inscribed_radius - inscribed)
                free = replace(free, values=np.minimum(free.values, free.tall.values - more), tall=None)
            clearances = (inscribed + self.clearance, inscribed + 0.01)
            self._to_go = to_go = cost_to_go(free, clearances, ahead, left, pose.xy, self.carrot)
            if to_go.reachable and math.dist(ahead[to_go.aim], pose.xy) < ARRIVED:
                self._progress.skip(to_go.aim)
        return self._to_go

    def _near_the_end(self, pose: Pose2D) -> bool:
        """Return whether pure pursuit can take over: what the map does not know must leave its way free."""
        assert self._progress is not None
        remaining = self._progress.remaining
        if remaining > self.hand_over or self._progress.beside(pose.xy) > 0.25:
            return False
        return remaining < 0.1 or self._free_of_what_is_seen(self._final_path(pose).points)

    def _free_of_what_is_seen(self, corners: NDArray[np.float64]) -> bool:
        points = densified(corners, 0.05)
        ahead = np.diff(points, axis=0)
        headings = np.arctan2(ahead[:, 1], ahead[:, 0])
        poses = (Pose2D(x, y, heading) for (x, y), heading in zip(points[1:].tolist(), headings.tolist(), strict=True))
        seen = self.obstacles.points
        return not len(seen) or all(self._motion.distance(p.inverse().apply(seen)).min() > 0.0 for p in poses)

    def _slow_before_the_end(self, wanted: Twist2D) -> Twist2D:
        assert self._limits is not None
        assert self._progress is not None
        before = max(0.0, self._progress.remaining - self.hand_over)
        speed = math.hypot(wanted.vx, wanted.vy)
        most = 0.12 + math.sqrt(self._limits.max_acceleration * before)
        return self._scaled(wanted, min(1.0, most / speed)) if speed else wanted

    def _final_path(self, pose: Pose2D) -> Path2D:
        """Return the path from here to where the exact entry begins, and from there as planned."""
        assert self._progress is not None
        points = self._progress.last(min(self.entry, self._progress.remaining))
        return Path2D(np.vstack([pose.xy, points]), self._path.goal)

    def _drive_exactly(self, path: Path2D) -> None:
        self.ends.reset(path)
        self._driving_exactly = True

    def _share_around(self, pose: Pose2D, twist: Twist2D) -> float:
        """Return how much of ``twist`` the base can brake from before anything around, known or seen."""
        reaction, braking, times = self._braking(twist)
        x, y, theta = arc(twist, times)
        cos, sin = math.cos(pose.theta), math.sin(pose.theta)
        poses = (pose.x + cos * x - sin * y, pose.y + sin * x + cos * y, pose.theta + theta)
        clearance = self._check.clearance(self.obstacles.distance, *(a.astype(np.float32) for a in poses))
        touches = (clearance < 0.0) & (clearance < clearance[0] - 1e-3)
        contact = float(times[max(0, int(touches.argmax()) - 1)]) if touches.any() else math.inf
        return safe_share(contact, reaction, braking)

    def _share_seen(self, pose: Pose2D, twist: Twist2D) -> float:
        """Return the same before what the map does not know."""
        reaction, braking, times = self._braking(twist)
        contact, _ = self._motion.contact(pose.inverse().apply(self._seen(pose)), twist, float(times[-1]))
        return safe_share(contact, reaction, braking)

    def _braking(self, twist: Twist2D) -> tuple[float, float, NDArray[np.float64]]:
        assert self._limits is not None
        reaction = self.reaction
        braking = braking_time(twist, self._limits.max_acceleration, self._limits.max_angular_acceleration)
        return reaction, braking, np.linspace(0.0, reaction + braking / 2.0 + 0.1, 16)

    def _seen(self, pose: Pose2D) -> NDArray[np.float64]:
        """Return points of obstacles that the map lacks and of moving ones, now and a moment ahead; map frame."""
        rim = np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False)
        circle = np.column_stack([np.cos(rim), np.sin(rim)])
        moving = [
            np.array([m.x + ahead * m.vx, m.y + ahead * m.vy]) + m.radius * circle
            for m in self.obstacles.moving.obstacles
            for ahead in (0.0, 0.4)
        ]
        return np.vstack([self.obstacles.points, *moving])

    @staticmethod
    def _scaled(twist: Twist2D, share: float) -> Twist2D:
        return twist if share == 1.0 else Twist2D(share * twist.vx, share * twist.vy, share * twist.wz)
