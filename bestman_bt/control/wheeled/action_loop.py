"""One driving action at a time: each control tick localises the base, then brings what it does a step on."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass

from bestman_bt.control.handle import ControlHandle
from bestman_bt.control.reading import READING_ERRORS
from bestman_bt.control.wheeled.base_action import BaseAction, DrivenPath
from bestman_bt.control.wheeled.collision_monitor import MonitorAction
from bestman_bt.control.wheeled.localisation_cycle import LocalisationCycle
from bestman_bt.control.wheeled.progress import ProgressWatch
from bestman_bt.control.wheeled.velocity_gate import VelocityGate
from bestman_bt.messages import MotionErrorCode, Pose2D, wrap_angle
from bestman_bt.navigation.local_planning import MovingObstacle, ObstacleLayer, PathFollower, RotateToHeading
from bestman_bt.world_model import BasePose, WorldModel
from hal.api import Clock, CommandRefusedError, MobileBase


@dataclass(frozen=True)
class ActionLoopParameters:
    """``position_tolerance`` (metres), ``heading_tolerance`` (radians): what counts as arrived.

    ``corrections``: turns to improve the heading. ``stall_*``: no progress of that many metres or radians in so many
    seconds is blocked; after ``stuck_time`` seconds the base counts as stuck. ``patience``: seconds that it stands at a
    stretch for somebody who walks before that is blocked, too.
    """

    position_tolerance: float = 0.02
    heading_tolerance: float = math.radians(0.7)
    corrections: int = 2
    stall_distance: float = 0.03
    stall_angle: float = math.radians(3.0)
    stall_time: float = 3.0
    stuck_time: float = 1.5
    patience: float = 15.0


class ActionLoop:
    """Runs the actions of a ``BaseController``: ``begin`` one, then ``tick`` at the rate of the localisation.

    ``lock``: held by each tick; who changes what a tick uses holds it, too.
    """

    def __init__(
        self,
        base: MobileBase,
        clock: Clock,
        where: LocalisationCycle,
        gate: VelocityGate,
        rotation: RotateToHeading,
        layer: ObstacleLayer,
        world: WorldModel,
        parameters: ActionLoopParameters,
        period: float,
    ) -> None:
        self._base, self._clock, self._where, self._gate = base, clock, where, gate
        self._rotation, self._layer, self._world = rotation, layer, world
        self._parameters, self._period = parameters, period
        self._action: BaseAction | None = None
        self.lock = threading.RLock()
        self._gave_up = False

    @property
    def stuck(self) -> bool:
        """Whether the action under way, or the last one where none has begun since, does not get the base on."""
        action = self._action
        if action is None or action.handle.done:
            return self._gave_up
        return action.follower is not None and action.watch.without > self._parameters.stuck_time

    @property
    def driven(self) -> DrivenPath | None:
        """The path that is driven, None where none is."""
        action = self._action
        return None if action is None or action.handle.done else action.driven

    def begin(
        self,
        follower: PathFollower | None,
        goal: Pose2D | None,
        position_tolerance: float | None = None,
        by_odometry: bool = False,
        driven: DrivenPath | None = None,
        speed: float | None = None,
    ) -> ControlHandle[BasePose]:
        """A new action, see ``BaseAction``; the one under way is superseded."""
        with self.lock:
            p = self._parameters
            tolerance = p.position_tolerance if position_tolerance is None else position_tolerance
            handle: ControlHandle[BasePose] = ControlHandle(self._base.stop)
            watch = ProgressWatch(p.stall_distance, p.stall_angle, p.stall_time)
            self._replace(BaseAction(handle, follower, goal, tolerance, watch, by_odometry, speed, driven))
            # One that is lost gets another chance; else one that is sent on again and again would never find out.
            self._where.look_again(forgive=self._where.lost)
            self._gave_up = False
            return handle

    def stop(self) -> None:
        """The action under way is cancelled, where there is one."""
        self._replace(None)

    def _replace(self, action: BaseAction | None) -> None:
        if self._action is not None:
            superseded = action is not None
            code = MotionErrorCode.SUPERSEDED if superseded else MotionErrorCode.STOPPED
            self._action.handle.abort(code, "a newer command took over" if superseded else "the base was stopped")
        self._action = action

    def tick(self) -> None:
        """One control tick."""
        with self.lock:
            try:
                self._where.step()
                if self._action is not None and self._action.handle.done:
                    self._action = None
                if self._action is not None:
                    self._advance(self._action)
            except CommandRefusedError as error:
                self._end(MotionErrorCode.STOPPED, str(error), aborted=True)
            except READING_ERRORS as error:
                if self._action is not None:
                    with contextlib.suppress(*READING_ERRORS):  # the base itself may be what is gone
                        self._base.stop()
                self._end(MotionErrorCode.DISCONNECTED, str(error))

    def _advance(self, action: BaseAction) -> None:
        if action.follower is None:
            self._settle(action)
            return
        where = self._where
        pose = where.odometry if action.by_odometry else where.estimate.pose
        if not action.by_odometry and not where.knows_where:
            estimate = where.estimate
            why = estimate.match.reason if estimate.match is not None and estimate.match.reason else "odometry alone"
            text = f"the base no longer knows where it is (±{estimate.position_std:.2f} m: {why})"
            where.lost = True
            self._halt(MotionErrorCode.LOST, text)
            return
        if where.lost and not action.by_odometry:
            where.look_again()  # stand and go on scanning: what begins while lost must not drive blindly
            return
        if action.watch.is_stuck(pose, self._clock.now()):
            text = f"the base does not get on at ({pose.x:.2f}, {pose.y:.2f}) m: {self._gate.held_by}"
            self._halt(MotionErrorCode.BLOCKED, text)
            return
        self._drive(action, action.follower, pose)

    def _drive(self, action: BaseAction, follower: PathFollower, pose: Pose2D) -> None:
        period, velocity, now = self._period, self._base.velocity(), self._clock.now()
        command = follower.compute(pose, velocity, period)
        people: Sequence[MovingObstacle] = ()
        if action.driven is not None:
            action.driven.swept.advance(pose.xy)
            people = self._layer.moving if action.driven.mapped else ()
        monitored = self._gate.command(
            command.twist, action.speed, velocity, pose, self._where.odometry, people, self._layer.walkers, period
        )
        if monitored.action is MonitorAction.BUMPED:
            self._halt(MotionErrorCode.BLOCKED, monitored.text)
            return
        if self._gate.waits:
            action.watch.restart()
            action.gave_way = now if action.gave_way is None else action.gave_way
            if now - action.gave_way > self._parameters.patience:
                self._halt(MotionErrorCode.BLOCKED, "people walk in the way of the base all the time")
        else:
            action.gave_way = None
        if command.done:
            action.follower = None
            self._where.look_again()

    def _settle(self, action: BaseAction) -> None:
        """Wait until the base rests and the scans taken there have told where, then judge."""
        p, goal = self._parameters, action.goal
        if not self._where.settled:
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
                self._end(MotionErrorCode.TOLERANCE, text)
                return
        action.handle.succeed(self._world.base)
        self._action = None

    def _halt(self, code: MotionErrorCode, text: str) -> None:
        self._base.stop()
        self._end(code, text)

    def _end(self, code: MotionErrorCode, text: str, aborted: bool = False) -> None:
        if self._action is not None:
            self._gave_up = code is MotionErrorCode.BLOCKED
            handle = self._action.handle
            if aborted:
                handle.abort(code, text)
            else:
                handle.fail(code, text)
            self._action = None
