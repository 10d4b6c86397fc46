"""Wheeled bases: localisation that runs all the time, and one driving action at a time on top of it."""

from __future__ import annotations

import contextlib
import math
import threading
from dataclasses import dataclass

import numpy as np

from bestman_bt.control.handle import ControlErrorCode, ControlHandle
from bestman_bt.control.reading import READING_ERRORS
from bestman_bt.control.wheeled.collision_monitor import CollisionMonitor, MonitorAction, MonitoredCommand
from bestman_bt.control.wheeled.motion_limits import motion_limits
from bestman_bt.control.wheeled.progress import ProgressWatch
from bestman_bt.messages import Path2D, Pose2D, Twist2D, wrap_angle
from bestman_bt.navigation.global_planning import Costmap
from bestman_bt.navigation.local_planning import PathFollower, RotateToHeading
from bestman_bt.navigation.localization import LocalizationEstimate, Localizer, OdometryScan, WheelOdometry
from bestman_bt.sensing.inertial import FusedOdometry
from bestman_bt.sensing.lidar import LidarSensor
from bestman_bt.world_model import BasePose, WorldModel
from hal.api import BaseDescription, Clock, CommandRefusedError, MobileBase, Timer


@dataclass(frozen=True)
class BaseControllerParameters:
    """``rate``: control hertz, 20 to 50. ``scan_every``: control ticks per lidar scan.

    ``settle_scans``: scans at rest before an action judges where it ended; after them a resting base scans only every
    ``rest_scan_every`` ticks, to notice when it is pushed.
    ``position_tolerance`` (metres), ``heading_tolerance`` (radians): what counts as arrived; ``corrections``: turns to
    improve the heading. ``stall_*``: no progress of that many metres or radians in so many seconds is blocked.
    ``lost_position_std``: metres, ``lost_scans``: scans refused in a row, above which the robot counts as lost; it does
    not drive again before a scan has fitted.
    """

    rate: float = 40.0
    scan_every: int = 4
    settle_scans: int = 5
    rest_scan_every: int = 40
    position_tolerance: float = 0.02
    heading_tolerance: float = math.radians(0.7)
    corrections: int = 2
    stall_distance: float = 0.03
    stall_angle: float = math.radians(3.0)
    stall_time: float = 3.0
    lost_position_std: float = 0.10
    lost_scans: int = 20
    still_speed: float = 0.01
    still_turn_rate: float = 0.01


class BaseController:
    """Drives one base by odometry and lidar; keeps ``world.base`` up to date from ``start`` to ``close``.

    A new action supersedes the one under way. Every handle's result is the believed pose at the end. ``odometry``: of
    wheels and gyroscope together; by default that of the wheels. ``monitor``: has the last word on each velocity; by
    default one without a bumper.
    """

    def __init__(
        self,
        base: MobileBase,
        clock: Clock,
        lidar: LidarSensor,
        localizer: Localizer,
        follower: PathFollower,
        world: WorldModel,
        parameters: BaseControllerParameters | None = None,
        rotation: RotateToHeading | None = None,
        odometry: FusedOdometry | None = None,
        monitor: CollisionMonitor | None = None,
    ) -> None:
        self._base, self._clock, self._lidar = base, clock, lidar
        self._localizer, self._follower, self._world = localizer, follower, world
        self._parameters = parameters or BaseControllerParameters()
        self._rotation = rotation or RotateToHeading()
        self._odometer = odometry or FusedOdometry(base, clock, WheelOdometry())
        self._monitor = monitor or CollisionMonitor(base.description)
        self._held_by = ""
        follower.configure(motion_limits(base.description))
        self._lock = threading.RLock()
        self._timer: Timer | None = None
        self._action: _Action | None = None
        self._ticks = 0
        self._scans_at_rest = 0
        self._refused_scans = 0
        self._lost = False
        self._odometry = Pose2D()

    @property
    def name(self) -> str:
        """The base's name in its robot."""
        return self._base.name

    @property
    def description(self) -> BaseDescription:
        """Limits and footprint of the base."""
        return self._base.description

    @property
    def estimate(self) -> LocalizationEstimate:
        """The localizer's estimate; RuntimeError before ``start``."""
        return self._localizer.estimate

    @property
    def lost(self) -> bool:
        """Whether the base does not know where it is: it drives by the map only after a scan has fitted again."""
        return self._lost

    @property
    def base_from_lidar(self) -> Pose2D:
        """The lidar's pose in the base frame."""
        return self._lidar.base_from_lidar

    def scan(self) -> OdometryScan:
        """What the lidar sees now; raises as its readings do."""
        with self._lock:
            return OdometryScan(self._odometer.pose(), self._lidar.scan())

    def start(self) -> None:
        """Begin to localise, from the believed ``world.base``; idempotent."""
        if self._timer is None:
            believed = self._world.base
            self._odometer.begin()
            self._odometry = self._odometer.pose()
            self._localizer.reset(believed.pose, self._odometry, believed.position_std, believed.heading_std)
            self._scans_at_rest = self._refused_scans = 0
            self._lost = believed.position_std > self._parameters.lost_position_std
            self._timer = self._clock.every(1.0 / self._parameters.rate, self._tick)

    def close(self) -> None:
        """Stop driving and localising; idempotent."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._replace(None)
            self._odometer.end()

    def believe(self, pose: Pose2D, position_std: float, heading_std: float) -> None:
        """Stop, and go on from another pose in the map frame; it is lost until a scan has fitted there."""
        with self._lock:
            self.stop()
            self._odometry = self._odometer.pose()
            self._localizer.reset(pose, self._odometry, position_std, heading_std)
            self._world.base = BasePose(pose, position_std, heading_std, self._clock.now())
            self._scans_at_rest = self._refused_scans = 0
            self._lost = True

    def localise_by(self, localizer: Localizer) -> Localizer:
        """Go on with another localizer from the pose that is believed now; returns the one before."""
        with self._lock:
            before, self._localizer = self._localizer, localizer
            believed = self._world.base
            self.believe(believed.pose, believed.position_std, believed.heading_std)
            return before

    def follow(self, path: Path2D, costmap: Costmap | None = None) -> ControlHandle[BasePose]:
        """Drive along a path in the map frame to its goal pose; ``costmap``: that it was planned on.

        Followers that go around obstacles leave the path only where they have a costmap.
        """
        self._follower.reset(path, costmap)
        return self._begin(self._follower, path.goal)

    def rotate_to(self, heading: float) -> ControlHandle[BasePose]:
        """Turn on the spot to ``heading``, radians in the map frame."""
        pose = self._world.base.pose
        self._rotation.turn_to(heading)
        return self._begin(self._rotation, Pose2D(pose.x, pose.y, heading), math.inf)

    def drive(self, distance: float) -> ControlHandle[BasePose]:
        """Drive straight, ``distance`` metres ahead, or back where it is negative; nothing is checked but progress."""
        pose = self._world.base.pose
        goal = pose @ Pose2D(distance, 0.0, 0.0)
        points = np.array([pose.xy, goal.xy])
        self._follower.reset(Path2D(points, goal, np.array([distance < 0.0])))
        return self._begin(self._follower, goal)

    def turn(self, angle: float) -> ControlHandle[BasePose]:
        """Turn on the spot by ``angle``, within ±pi, as the odometry counts it: also where the base is lost."""
        self._rotation.turn_to(wrap_angle(self._odometry.theta + angle))
        return self._begin(self._rotation, None, by_odometry=True)

    def park(self) -> ControlHandle[BasePose]:
        """Come to rest, hold the wheels and let the localisation settle."""
        with self._lock:
            self._base.stop()
            return self._begin(None, None)

    def stop(self) -> None:
        """Bring the base to rest at once; what was under way is cancelled."""
        with self._lock:
            self._base.stop()
            self._replace(None)

    def _begin(
        self,
        follower: PathFollower | None,
        goal: Pose2D | None,
        position_tolerance: float | None = None,
        by_odometry: bool = False,
    ) -> ControlHandle[BasePose]:
        with self._lock:
            if self._timer is None:
                raise RuntimeError("BaseController was asked to drive before start()")
            p = self._parameters
            tolerance = p.position_tolerance if position_tolerance is None else position_tolerance
            handle: ControlHandle[BasePose] = ControlHandle(self._base.stop)
            watch = ProgressWatch(p.stall_distance, p.stall_angle, p.stall_time)
            self._replace(_Action(handle, follower, goal, tolerance, watch, by_odometry))
            self._scans_at_rest = self._refused_scans = 0
            return handle

    def _replace(self, action: _Action | None) -> None:
        if self._action is not None:
            superseded = action is not None
            code = ControlErrorCode.SUPERSEDED if superseded else ControlErrorCode.STOPPED
            self._action.handle.abort(code, "a newer command took over" if superseded else "the base was stopped")
        self._action = action

    def _tick(self) -> None:
        with self._lock:
            try:
                self._localise()
                if self._action is not None and self._action.handle.done:
                    self._action = None
                if self._action is not None:
                    self._advance(self._action)
            except CommandRefusedError as error:
                self._end(ControlErrorCode.STOPPED, str(error), aborted=True)
            except READING_ERRORS as error:
                if self._action is not None:
                    with contextlib.suppress(*READING_ERRORS):  # the base itself may be what is gone
                        self._base.stop()
                self._end(ControlErrorCode.DISCONNECTED, str(error))

    def _localise(self) -> None:
        p = self._parameters
        odometry = self._odometer.pose()
        moved = self._odometry.inverse() @ odometry
        self._odometry = odometry
        if math.hypot(moved.x, moved.y) * p.rate > p.still_speed or abs(moved.theta) * p.rate > p.still_turn_rate:
            self._scans_at_rest = 0
        estimate = self._localizer.predict(odometry)
        self._ticks += 1
        settled = self._scans_at_rest >= p.settle_scans and not self._lost
        every = p.rest_scan_every if settled else p.scan_every
        if self._ticks % every == 0:
            scan, base_from_lidar = self._lidar.scan(), self._lidar.base_from_lidar
            estimate = self._localizer.correct(scan, base_from_lidar)
            self._monitor.observe(scan, base_from_lidar, odometry)
            self._follower.observe(scan, estimate.pose @ base_from_lidar)
            self._scans_at_rest += 1
            if estimate.match is not None and estimate.match.accepted:
                self._refused_scans, self._lost = 0, False
            else:
                self._refused_scans += 1
        self._world.base = BasePose(estimate.pose, estimate.position_std, estimate.heading_std, self._clock.now())

    def _advance(self, action: _Action) -> None:
        p, estimate = self._parameters, self._localizer.estimate
        if action.follower is None:
            self._settle(action)
            return
        pose = self._odometry if action.by_odometry else estimate.pose
        if not action.by_odometry and not self._knows_where(estimate):
            why = estimate.match.reason if estimate.match is not None and estimate.match.reason else "odometry alone"
            text = f"the base no longer knows where it is (±{estimate.position_std:.2f} m: {why})"
            self._lost = True
            self._halt(ControlErrorCode.LOST, text)
            return
        if self._lost and not action.by_odometry:
            self._scans_at_rest = 0  # stand and go on scanning: what begins while lost must not drive blindly
            return
        if action.watch.is_stuck(pose, self._clock.now()):
            why = self._held_by or "something is in its way"
            text = f"the base does not get on at ({pose.x:.2f}, {pose.y:.2f}) m: {why}"
            self._halt(ControlErrorCode.BLOCKED, text)
            return
        velocity = self._base.velocity()
        command = action.follower.compute(pose, velocity, 1.0 / p.rate)
        monitored = self._command(command.twist, velocity)
        if monitored.action is MonitorAction.BUMPED:
            self._halt(ControlErrorCode.BLOCKED, monitored.text)
            return
        if command.done:
            action.follower = None
            self._scans_at_rest = 0

    def _knows_where(self, estimate: LocalizationEstimate) -> bool:
        p = self._parameters
        return estimate.position_std <= p.lost_position_std and self._refused_scans < p.lost_scans

    def _settle(self, action: _Action) -> None:
        """Wait until the base rests and the scans taken there have told where, then judge."""
        p, goal = self._parameters, action.goal
        if self._scans_at_rest < p.settle_scans:
            return
        pose = self._world.base.pose
        if goal is not None:
            distance, turn = pose.distance_to(goal), abs(wrap_angle(pose.theta - goal.theta))
            if turn > p.heading_tolerance and action.corrections < p.corrections:
                action.corrections += 1
                self._rotation.turn_to(goal.theta)
                action.follower = self._rotation
                return
            if distance > action.position_tolerance or turn > 2.0 * p.heading_tolerance:
                text = f"the base came to rest {1e3 * distance:.0f} mm and {math.degrees(turn):.1f}° from its goal"
                self._end(ControlErrorCode.TOLERANCE, text)
                return
        action.handle.succeed(self._world.base)
        self._action = None

    def _command(self, twist: Twist2D, velocity: Twist2D) -> MonitoredCommand:
        limits = self._base.description
        over = max(1.0, abs(twist.vx) / limits.max_vx, abs(twist.wz) / limits.max_wz)
        # Both are scaled alike, so that the curvature stays.
        wanted = Twist2D(twist.vx / over, twist.vy / over if limits.max_vy else 0.0, twist.wz / over)
        monitored = self._monitor.limit(wanted, velocity, self._odometry)
        self._held_by = monitored.text
        if monitored.brake:
            self._base.stop()
        else:
            self._base.set_velocity(monitored.twist.vx, monitored.twist.vy, monitored.twist.wz)
        return monitored

    def _halt(self, code: ControlErrorCode, text: str) -> None:
        self._base.stop()
        self._end(code, text)

    def _end(self, code: ControlErrorCode, text: str, aborted: bool = False) -> None:
        if self._action is not None:
            handle = self._action.handle
            if aborted:
                handle.abort(code, text)
            else:
                handle.fail(code, text)
            self._action = None


@dataclass
class _Action:
    """What the base is doing: driving by ``follower`` (None: coming to rest), towards ``goal`` (None: wherever).

    ``by_odometry``: in its frame, without the map.
    """

    handle: ControlHandle[BasePose]
    follower: PathFollower | None
    goal: Pose2D | None
    position_tolerance: float
    watch: ProgressWatch
    by_odometry: bool = False
    corrections: int = 0
