"""Control of wheeled bases: continuous localisation, and one driving action at a time."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.control.motion import Confirm, PlannedMotion, outline, turned
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor, MonitorAction
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle, PlacedScan
from bestman_bt.control.wheeled.velocity_gate import STANDING, VelocityGate
from bestman_bt.errors import WrongResultError
from bestman_bt.messages import Failure, MotionErrorCode, Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.local_planning.base import PathFollower
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading
from bestman_bt.navigation.local_planning.swept_path import SweptPath
from bestman_bt.navigation.localization.base import Localizer, OdometryScan
from bestman_bt.world_model.world_model import BasePose
from hal.api import CommandRefusedError, MobileBase, Motion, MotionStatus, RobotStoppedError, Timer

RESTS = 0.02
"""Speed below which a base counts as stopped, m/s."""


@dataclass(frozen=True)
class Driving:
    """Parameters of driving. ``position_tolerance`` (metres), ``heading_tolerance`` (radians): of the goal.

    ``corrections``: turns to improve the heading. ``stall_*``: progress below these metres or radians in this time is
    blocked; after ``stuck_time`` seconds the base counts as stuck. ``patience``: seconds to wait for a walking person
    before that counts as blocked.
    """

    position_tolerance: float = 0.02
    heading_tolerance: float = math.radians(0.7)
    corrections: int = 2
    stall_distance: float = 0.03
    stall_angle: float = math.radians(3.0)
    stall_time: float = 3.0
    stuck_time: float = 1.5
    patience: float = 15.0
    rotation: RotateToHeading = field(default_factory=RotateToHeading)


@dataclass(frozen=True, eq=False)
class _DrivenPath:
    """``swept`` holds how far along ``path`` the base is. ``mapped``: it was planned on a map that is known."""

    path: Path2D
    swept: SweptPath
    mapped: bool


@dataclass
class _Action:
    """Driving by ``follower`` (None: coming to rest), towards ``goal`` (None: wherever).

    ``by_odometry``: in its frame, without the map. ``speed``: m/s, no faster than that. ``corrections``: of the
    heading, made so far. ``gave_way``: seconds when it last stopped for a pedestrian, None while it does
    not.
    """

    motion: Motion[BasePose]
    follower: PathFollower | None
    goal: Pose2D | None
    position_tolerance: float
    watch: ProgressWatch
    by_odometry: bool = False
    speed: float | None = None
    driven: _DrivenPath | None = None
    corrections: int = 0
    gave_way: float | None = None


class BaseController:
    """Drives one base by odometry and lidar; keeps ``world.base`` up to date from ``start`` to ``close``.

    A new action supersedes the current one. The result of every motion is the believed final pose. ``localisation``: by
    odometry and lidar; it also provides the clock and the world model. ``monitor``: the collision monitor of each
    velocity; by default one without a bumper. ``layer``: obstacles that the lidar sees but the map lacks. ``model``:
    limits and footprint. ``confirm``: asks a person before each action, which fails as DECLINED if refused.
    ``speed_limit``: m/s for all actions until changed; None: the base's own; 0: stop. ``surroundings``: costmap of the
    mapped obstacles with the current arm, for drives without a costmap. ``last_scan``: the latest scan of the
    localisation, for display.
    """

    def __init__(
        self,
        base: MobileBase,
        localisation: LocalisationCycle,
        follower: PathFollower,
        driving: Driving = Driving(),
        monitor: CollisionMonitor | None = None,
        layer: ObstacleLayer | None = None,
        confirm: Confirm | None = None,
    ) -> None:
        self._confirm = confirm
        self._driving, self._rotation = driving, driving.rotation
        self._base, self.follower = base, follower
        self.localisation, self.lidar = localisation, localisation.lidar
        self._clock, self._world, self._period = localisation.clock, localisation.world, localisation.period
        localisation.seen = self._observe
        self._gate = VelocityGate(base, monitor or CollisionMonitor(base.model))
        self.model, self.layer = base.model, layer or ObstacleLayer()
        self.speed_limit: float | None = None
        self.surroundings: Callable[[], Costmap] | None = None
        self.last_scan: PlacedScan | None = None
        self._timer: Timer | None = None
        self.own_follower = follower
        self._action: _Action | None = None
        self._gave_up = False
        self._lock = threading.RLock()  # held by each tick, and by any thread that changes what a tick uses
        follower.configure(base.model)

    @property
    def path(self) -> Path2D | None:
        """The path being driven, or None."""
        return None if self._driven is None else self._driven.path

    @property
    def remaining(self) -> float:
        """Remaining length of ``path``, metres; 0 without a path."""
        return 0.0 if self._driven is None else self._driven.swept.remaining

    @property
    def stuck(self) -> bool:
        """True while the base is stalled, or if the last action ended stalled."""
        action = self._action
        if action is None or action.motion.done:
            return self._gave_up
        return action.follower is not None and action.watch.without > self._driving.stuck_time

    def pose_at(self, stamp: float) -> Pose2D:
        """Return the believed pose of the base at a time, in the map frame. Raises NotRecordedError outside the last
        seconds.
        """
        with self._lock:
            return self.localisation.pose_at(stamp)

    def velocity(self) -> Twist2D:
        """Return the measured velocity in the base frame. Raises NotConnectedError or NoDataError."""
        return self._base.velocity()

    def blocked_at(self) -> tuple[float, NDArray[np.float64]] | None:
        """Return the first unmapped obstacle on the current path: distance in metres, and point (2,); or None."""
        driven, pose = self._driven, self._world.base.pose
        if driven is None or not len(self.layer.points):
            return None
        here = np.array([pose.x, pose.y, pose.theta])
        return driven.swept.contact(here, self.layer.points, self._gate.outline)

    def scan(self) -> OdometryScan:
        """Return the current lidar scan. Raises NotConnectedError or NoDataError."""
        with self._lock:
            return self.localisation.scan()

    def start(self) -> None:
        """Start localising from the believed ``world.base``; idempotent."""
        if self._timer is None:
            self.localisation.begin()
            self.layer.use_costmap(Costmap.from_map(self._world.map, Footprint.of(self.model)))
            self._timer = self._clock.every(self._period, self._tick)

    def close(self) -> None:
        """Stop driving and localising; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._replace(None)
            self.localisation.end()

    def believe(self, pose: Pose2D, position_std: float, heading_std: float) -> None:
        """Stop, and continue from another pose in the map frame; the base counts as lost until a scan fits."""
        with self._lock:
            self.stop()
            self.localisation.believe(BasePose(pose, position_std, heading_std, self._clock.now()))
            self.layer.clear()

    def localise_by(self, localizer: Localizer) -> Localizer:
        """Switch to another localizer at the believed pose; returns the previous one."""
        with self._lock:
            before, self.localisation.localizer = self.localisation.localizer, localizer
            believed = self._world.base
            self.believe(believed.pose, believed.position_std, believed.heading_std)
            return before

    def follow(
        self, path: Path2D, costmap: Costmap | None = None, follower: PathFollower | None = None
    ) -> Motion[BasePose]:
        """Drive along a path in the map frame to its goal pose; ``costmap``: of the map, without ``layer``.

        With it, the base gives way to walking people, and obstacle-avoiding followers may leave the path. ``follower``:
        for this path only. A base at rest within the tolerance of the goal of its current path only turns if it gets
        another path to that goal: otherwise a base that gets a path each second would turn back and forth with the
        localisation's noise.
        """
        with self._lock:
            if self._has_come_to(path.goal):
                path = Path2D(path.goal.xy[None], path.goal)
            self._follow_by(follower or self.own_follower)
            if costmap is not None:
                self.layer.use_costmap(costmap)
            self.follower.reset(path, costmap)
            driven = _DrivenPath(path, SweptPath(path), costmap is not None)
            return self._begin(self.follower, path.goal, driven=driven, known=costmap)

    def rotate_to(self, heading: float) -> Motion[BasePose]:
        """Turn in place to ``heading``, radians in the map frame."""
        pose = self._world.base.pose
        self._rotation.turn_to(heading)
        return self._begin(self._rotation, Pose2D(pose.x, pose.y, heading), math.inf)

    def drive(self, distance: float, speed: float | None = None) -> Motion[BasePose]:
        """Drive straight by ``distance`` metres, backwards if negative; only progress is checked.

        ``speed``: upper limit, m/s.
        """
        pose = self._world.base.pose
        goal = pose @ Pose2D(distance, 0.0, 0.0)
        points = np.array([pose.xy, goal.xy])
        with self._lock:
            self._follow_by(self.own_follower)
            self.follower.reset(Path2D(points, goal, np.array([distance < 0.0])))
            return self._begin(self.follower, goal, speed=speed)

    def turn(self, angle: float) -> Motion[BasePose]:
        """Turn in place by ``angle``, within ±pi rad, by odometry; also works while the base is lost."""
        self._rotation.turn_to(wrap_angle(self.localisation.odometry.theta + angle))
        return self._begin(self._rotation, None, by_odometry=True)

    def park(self) -> Motion[BasePose]:
        """Brake to rest, hold the wheels and wait for the localisation to converge."""
        with self._lock:
            self._base.stop()
            return self._begin(None, None)

    def stop(self) -> None:
        """Stop the base immediately and cancel the current motion."""
        with self._lock:
            self._base.stop()
            self._replace(None)

    @property
    def _driven(self) -> _DrivenPath | None:
        """The path being driven, or None."""
        action = self._action
        return None if action is None or action.motion.done else action.driven

    def _has_come_to(self, goal: Pose2D) -> bool:
        """Return whether the current path leads to ``goal``, and the base already turns there."""
        driven = self._driven
        if driven is None or driven.path.goal != goal:
            return False
        velocity = self._base.velocity()
        rests = math.hypot(velocity.vx, velocity.vy) < RESTS
        return rests and self._world.base.pose.distance_to(goal) < self._driving.position_tolerance

    def _follow_by(self, follower: PathFollower) -> None:
        if follower is not self.follower:
            follower.configure(self.model)
            self.follower = follower

    def _observe(self, seen: PlacedScan) -> None:
        self.last_scan = seen
        self._gate.observe(seen.scan, self.lidar.base_from_lidar, seen.odometry)
        self.follower.observe(seen.scan, seen.map_from_lidar)
        if seen.fits:
            self.layer.update(seen.scan, seen.map_from_lidar)

    def _begin(
        self,
        follower: PathFollower | None,
        goal: Pose2D | None,
        position_tolerance: float | None = None,
        by_odometry: bool = False,
        driven: _DrivenPath | None = None,
        speed: float | None = None,
        known: Costmap | None = None,
    ) -> Motion[BasePose]:
        """Return a new action, see ``_Action``; the current one is superseded. ``known``: by default
        ``surroundings``.
        """
        if self._timer is None:
            raise RuntimeError("BaseController was asked to drive before start()")
        with self._lock:
            if known is None and follower is not None and self.surroundings is not None:
                known = self.surroundings()
            footprint = Footprint.of(self.model) if known is None else known.footprint
            self._gate.use_footprint(footprint, known)
            p = self._driving
            tolerance = p.position_tolerance if position_tolerance is None else position_tolerance
            motion: Motion[BasePose] = Motion(self._base.name, self._base.stop)
            if follower is not None and self._confirm is not None:
                planned = self._planned(goal, driven, by_odometry)
                if not self._confirm(planned):
                    self._replace(None)
                    motion.fail(MotionErrorCode.DECLINED, f"a person declined: {planned.words}")
                    return motion
            watch = ProgressWatch(p.stall_distance, p.stall_angle, p.stall_time)
            self._replace(_Action(motion, follower, goal, tolerance, watch, by_odometry, speed, driven))
            # One that is lost gets another chance; else one that is sent on again and again would never find out.
            self.localisation.look_again(forgive=self.localisation.lost)
            self._gave_up = False
            return motion

    def _planned(self, goal: Pose2D | None, driven: _DrivenPath | None, by_odometry: bool) -> PlannedMotion:
        """Return the outline of the base along the path for display, or a circle around it for a turn in place."""
        here, corners = self._world.base.pose, np.array(self.model.footprint)
        if goal is None or (driven is None and goal.distance_to(here) < STANDING):
            around = turned(corners, np.linspace(-math.pi, math.pi, 24)) + here.xy
            words = "turn on the spot" if goal is None or by_odometry else f"turn to {math.degrees(goal.theta):.0f}°"
            return PlannedMotion(self._base.name, words, swept=(outline(around),))
        points = np.array([here.xy, goal.xy]) if driven is None else driven.path.points
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        taken = points[np.linspace(0, len(points) - 1, min(len(points), 40)).astype(int)]
        ways = np.diff(taken, axis=0)
        headings = np.arctan2(ways[:, 1], ways[:, 0])
        pieces = [
            outline(np.concatenate([turned(corners, [heading]) + start, turned(corners, [heading]) + end]))
            for heading, start, end in zip(headings, taken, taken[1:], strict=False)
        ]
        words = f"{length:.2f} m to x {goal.x:.2f}, y {goal.y:.2f}, {math.degrees(goal.theta):.0f}°"
        return PlannedMotion(self._base.name, words, length / self.model.part.max_vx, tuple(pieces))

    def _replace(self, action: _Action | None) -> None:
        """Cancel the current action, if any."""
        if self._action is not None:
            superseded = action is not None
            code = MotionErrorCode.SUPERSEDED if superseded else MotionErrorCode.STOPPED
            self._action.motion.abort(code, "a newer command took over" if superseded else "the base was stopped")
        self._action = action

    def _tick(self) -> None:
        """Run one control period."""
        with self._lock:
            try:
                self.localisation.step()
                if self._action is not None and self._action.motion.done:
                    self._action = None
                if self._action is not None:
                    self._advance(self._action)
            except RobotStoppedError as error:
                self._end_stopped(error)
            except WrongResultError as error:
                if self._action is None:
                    raise
                self._base.stop()
                self._end(MotionStatus.FAILED, Failure(error.code, str(error)))
            except (CommandRefusedError, *READING_ERRORS) as error:
                if self._action is not None:
                    with contextlib.suppress(*READING_ERRORS):  # the base itself may be what is gone
                        self._base.stop()
                self._end(MotionStatus.FAILED, error.failure)

    def _end_stopped(self, refused: RobotStoppedError) -> None:
        """End the motion after a stop of the robot; a lost base controller is given as the reason."""
        try:
            self._base.odometry()
        except READING_ERRORS as error:
            self._end(MotionStatus.FAILED, error.failure)
        else:
            self._end(MotionStatus.CANCELED, refused.failure)

    def _advance(self, action: _Action) -> None:
        if action.follower is None:
            self._settle(action)
            return
        where = self.localisation
        pose = where.odometry if action.by_odometry else where.estimate.pose
        if not action.by_odometry and not where.is_localized:
            where.lost = True
            self._halt(MotionErrorCode.LOST, where.lost_reason)
            return
        if where.lost and not action.by_odometry:
            where.look_again()  # stand and go on scanning: what begins while lost must not drive blindly
            return
        if action.watch.is_stuck(pose, self._clock.now(), self._base.speed_share):
            text = f"the base has stalled at ({pose.x:.2f}, {pose.y:.2f}) m: {self._gate.held_by}"
            self._halt(MotionErrorCode.BLOCKED, text)
            return
        self._drive(action, action.follower, pose)

    def _drive(self, action: _Action, follower: PathFollower, pose: Pose2D) -> None:
        period, velocity, now, where = self._period, self._base.velocity(), self._clock.now(), self.localisation
        command = follower.compute(pose, velocity, period)
        if not np.isfinite([command.twist.vx, command.twist.vy, command.twist.wz]).all():
            kind = type(follower).__name__
            raise WrongResultError(f"{kind}.compute should return a finite velocity but returned {command.twist}")
        people: Sequence[MovingObstacle] = ()
        if action.driven is not None:
            action.driven.swept.advance(pose.xy)
            people = self.layer.moving.obstacles if action.driven.mapped else ()
        self._gate.placed = where.is_localized and not where.lost
        allowed = [limit for limit in (self.speed_limit, action.speed) if limit is not None]
        monitored = self._gate.command(
            command.twist,
            min(allowed, default=None),
            velocity,
            where.estimate.pose,
            where.odometry,
            people,
            self.layer.moving.walkers,
            period,
        )
        if monitored.action is MonitorAction.BUMPED:
            self._halt(MotionErrorCode.BLOCKED, monitored.text)
            return
        if self._gate.waits:
            action.watch.restart()
            action.gave_way = now if action.gave_way is None else action.gave_way
            if now - action.gave_way > self._driving.patience:
                self._halt(MotionErrorCode.BLOCKED, "people block the base continuously")
        else:
            action.gave_way = None
        if command.done:
            action.follower = None
            self.localisation.look_again()

    def _settle(self, action: _Action) -> None:
        """Wait until the base rests and the scans taken there give its pose, then judge."""
        p, goal = self._driving, action.goal
        if not self.localisation.settled:
            return
        pose = self._world.base.pose
        if goal is not None:
            distance, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
            if turn > p.heading_tolerance and action.corrections < p.corrections:
                action.corrections += 1
                self._rotation.turn_to(goal.theta)
                action.follower = self._rotation
                return
            accepted, accepted_turn = action.position_tolerance, 2.0 * p.heading_tolerance
            if distance > accepted or turn > accepted_turn:
                text = (
                    f"the base came to rest {1e3 * distance:.0f} mm and {math.degrees(turn):.1f}° from its goal; "
                    f"up to {1e3 * accepted:.0f} mm and {math.degrees(accepted_turn):.1f}° are accepted"
                )
                self._end(MotionStatus.FAILED, Failure(MotionErrorCode.TOLERANCE, text))
                return
        action.motion.succeed(self._world.base)
        self._action = None

    def _halt(self, code: MotionErrorCode, text: str) -> None:
        self._base.stop()
        self._end(MotionStatus.FAILED, Failure(code, text))

    def _end(self, status: MotionStatus, failure: Failure) -> None:
        if self._action is not None:
            self._gave_up = failure.code is MotionErrorCode.BLOCKED
            self._action.motion.end(status, failure)
            self._action = None


LONGEST_LOOK = 1.0
"""Largest time between two checks of a driving base's progress, seconds."""


class ProgressWatch:
    """Like Nav2's progress checker: within ``time`` seconds a base should move ``distance`` metres or turn by ``angle``
    radians.
    """

    def __init__(self, distance: float, angle: float, time: float) -> None:
        self._distance, self._angle, self._time = distance, angle, time
        self._pose: Pose2D | None = None
        self._looked_at = 0.0
        self.without = 0.0
        """Seconds without progress, as of the last pose."""

    def restart(self) -> None:
        """Restart the measurement after the base was intentionally at rest."""
        self._pose = None

    def is_stuck(self, pose: Pose2D, now: float, speed_share: float = 1.0) -> bool:
        """Return whether the base makes no progress; call it with its pose at ``now``, seconds. A smaller
        ``speed_share`` allows more time.

        Pauses without commands do not count.
        """
        moved = self._pose is None or pose.distance_to(self._pose) > self._distance
        if self._pose is None or moved or abs(wrap_angle(pose.theta - self._pose.theta)) > self._angle:
            self._pose, self.without = pose, 0.0
        else:
            self.without += speed_share * min(now - self._looked_at, LONGEST_LOOK)
        self._looked_at = now
        return self.without > self._time
