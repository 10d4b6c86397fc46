"""Coordination of several moving arms: an arm starts only if its path does not cross the remaining path of another
arm.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.joint_state import READING_ERRORS, JointStateSensor
from bestman_bt.manipulation.collision.swept_volume import SweptVolume
from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies
from bestman_bt.messages import MotionErrorCode
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.world_model.world_model import WorldModel
from hal.api import Clock, Motion, MotionStatus, Timer

Result = TypeVar("Result")


@dataclass(frozen=True)
class Passing:
    """Parameters of the right of way.

    ``margin``: metres from the path of a moving arm, which deviates from its plan. ``period``: seconds between two
    checks. ``patience``: seconds after which a waiting arm gives up. ``same``: radians within which an arm counts as
    being at its planned place.
    """

    margin: float = 0.01
    period: float = 0.1
    patience: float = 30.0
    same: float = 0.02


@dataclass
class _UnderWay:
    motion: Motion[Any]
    way: SweptVolume | None  # None: not known in advance (move_until, follow_constraint)
    reached: int = 0


class ArmCoordinator:
    """The current motions of a robot's arms, and which arms have to wait. An arm that starts while another one moves
    waits until the rest of the other's path is clear of its own. It fails as ``other_arm_in_the_way`` after
    ``patience``, or immediately if the other arm rests, or will come to rest, on its path: then another path is needed.
    Motions of unknown path (``move_until``, ``follow_constraint``) run one at a time. A motion that supersedes one of
    the same arm does not wait; it fails instead.
    """

    def __init__(
        self,
        robot: RobotModel,
        joints: JointStateSensor,
        world: WorldModel,
        clock: Clock,
        passing: Passing | None = None,
    ) -> None:
        self._arms = robot.of(ArmModel)
        self._bodies = {name: ArmBodies(robot, name) for name in self._arms}
        self._joints, self._world, self._clock, self._passing = joints, world, clock, passing or Passing()
        self._under_way: dict[str, _UnderWay] = {}
        self._waiting: dict[str, _Turn[Any]] = {}
        self._planned_with: dict[str, Mapping[str, float]] = {}

    def for_planning(self, arm: str) -> Mapping[str, float]:
        """Return measured joint positions by name, with other moving arms at their targets."""
        positions = dict(self._joints.positions())
        for other in (name for name in self._arms if name != arm):
            moving = self._moving(other)
            if moving is not None and moving.way is not None:
                end = moving.way.positions[-1].tolist()
                positions.update(zip(self._arms[other].joint_names, end, strict=True))
        self._planned_with[arm] = positions
        return positions

    def start(
        self, arm: str, path: NDArray[np.float64] | None, command: Callable[[], Motion[Result]]
    ) -> Motion[Result]:
        """Return the motion that ``command`` starts, now or as soon as the path is free.

        ``path``: (N, n) joint positions, from the current ones, or None if unknown.
        """
        self.end_waiting(arm, MotionErrorCode.SUPERSEDED, "a newer command took over")
        turn = _Turn(self, arm, path, command)
        takes_over = arm in self._under_way and not self._under_way[arm].motion.done
        turn.attempt(0.0 if takes_over else self._passing.patience)
        if not turn.done and turn.started is None:
            self._waiting[arm] = turn
            turn.watch(self._clock, self._passing)
        return turn.started or turn

    def end_waiting(self, arm: str, code: MotionErrorCode, text: str) -> None:
        """End a motion of the arm that waits for its turn."""
        if arm in self._waiting:
            self._waiting.pop(arm).abort(code, text)

    def began(self, arm: str, motion: Motion[Any], way: SweptVolume | None) -> None:
        """Record that ``arm`` has started ``motion``."""
        self._under_way[arm] = _UnderWay(motion, way)
        self._waiting.pop(arm, None)

    def swept(self, arm: str, path: NDArray[np.float64]) -> SweptVolume:
        """Return the volume swept by the arm on a path (N, n)."""
        held, names = self._world.hands.get(arm), self._arms[arm].joint_names
        return SweptVolume(self._bodies[arm], names, path, self._joints.positions(), held)

    def obstacle(self, arm: str, way: SweptVolume | None) -> tuple[str, bool] | None:
        """Return the arm that blocks ``arm``, and whether it will move out of the way; or None."""
        measured = self._joints.positions()
        for other in (name for name in self._arms if name != arm):
            moving = self._moving(other)
            theirs = None if moving is None else moving.way
            if moving is not None and (way is None or theirs is None):
                return other, True
            if way is None:
                continue
            now = np.array([measured[name] for name in self._arms[other].joint_names])
            end = now if theirs is None else theirs.positions[-1]
            if not self._was_planned_with(arm, other, end) and self.swept(other, end[None]).is_near(way, 0.0):
                return other, False
            if moving is not None and theirs is not None:
                moving.reached = theirs.reached(now, moving.reached)
                if theirs.is_near(way, self._passing.margin, moving.reached):
                    return other, True
        return None

    def _moving(self, arm: str) -> _UnderWay | None:
        motion = self._under_way.get(arm)
        return None if motion is None or motion.motion.done else motion

    def _was_planned_with(self, arm: str, other: str, end: NDArray[np.float64]) -> bool:
        """Return whether the last path of ``arm`` was planned with ``other`` at ``end``: then the planner has judged
        that.
        """
        known, names = self._planned_with.get(arm, {}), self._arms[other].joint_names
        taken = np.array([known.get(name, np.inf) for name in names])
        return bool(np.abs(taken - end).max() <= self._passing.same)


class _Turn(Motion[Result]):
    """A motion that starts once the way is free; ``started``: from then on."""

    def __init__(
        self,
        coordinator: ArmCoordinator,
        arm: str,
        path: NDArray[np.float64] | None,
        command: Callable[[], Motion[Result]],
    ) -> None:
        super().__init__(arm, self._cancel_started)
        self._coordinator, self._arm, self._command = coordinator, arm, command
        self._way = None if path is None else coordinator.swept(arm, path)
        self._timer: Timer | None = None
        self.started: Motion[Result] | None = None

    def attempt(self, left: float) -> None:
        """Start the motion unless another arm blocks it; fail if it stays blocked for ``left`` seconds."""
        try:
            obstacle = self._coordinator.obstacle(self._arm, self._way)
            if obstacle is None:
                self.started = self._command()
                self._coordinator.began(self._arm, self.started, self._way)
                return
        except READING_ERRORS as error:
            self.end(MotionStatus.FAILED, error.failure)
            return
        other, passes = obstacle
        if not passes:
            self.fail(MotionErrorCode.OTHER_ARM_IN_THE_WAY, f"arm {other} rests in its way")
        elif left <= 0.0:
            self.fail(MotionErrorCode.OTHER_ARM_IN_THE_WAY, f"arm {other} blocks its path for longer than it waits")

    def watch(self, clock: Clock, passing: Passing) -> None:
        """Repeat the attempt."""
        end = clock.now() + passing.patience
        self._timer = clock.every(passing.period, lambda: self._tick(end - clock.now()))

    def _tick(self, left: float) -> None:
        if not self.done and self.started is None:
            self.attempt(left)
        if self._timer is not None and (self.started is not None or self.done):
            self._timer.cancel()

    def _cancel_started(self) -> None:
        if self.started is not None:
            self.started.cancel()

    def _look(self) -> None:
        started = self.started
        if started is not None and started.done:
            self.end(started.status, started.failure, started.result)
