"""Arm controller: monitored trajectories, guarded moves, and following of doors and drawers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.control.arm.arm_coordinator import ArmCoordinator
from bestman_bt.control.arm.constraint_following import ConstraintFollowing, FollowedMotion, FollowGoal, Following
from bestman_bt.control.arm.guarded_move import (
    GuardedMove,
    GuardedOutcome,
    Guarding,
    Streaming,
    ToolStream,
    check_positive,
)
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.control.motion import Confirm, PlannedMotion, declined, outline, start_motion
from bestman_bt.control.touch import WristWrench
from bestman_bt.manipulation.kinematics.base import InverseKinematics
from bestman_bt.messages import Failure, JointKind, JointTrajectory, MotionErrorCode
from hal.api import Arm, Clock, CommandRefusedError, Motion, MotionStatus, RobotStoppedError, Timer


@dataclass(frozen=True)
class ContactLimits:
    """Thresholds of contact detection.

    ``force``: newtons, above the inertial forces of hand and load. ``lag``: radians behind the set-point. ``samples``:
    consecutive samples that must agree. ``period``: seconds between two checks. ``latency``: smallest delay of the
    encoders behind the set-points, seconds; the arm's own may be longer.
    """

    force: float = 30.0
    lag: float = 0.04
    samples: int = 2
    period: float = 1.0 / 60.0
    latency: float = 0.02


class ContactMonitor:
    """Monitors one free motion for contacts; ``objection`` is called every ``period``.

    The force is relative to the wrist's reading at the start, so that the weight of a held object is excluded.
    """

    def __init__(
        self,
        arm: Arm,
        clock: Clock,
        wrist: WristWrench | None,
        trajectory: JointTrajectory | None = None,
        limits: ContactLimits = ContactLimits(),
    ) -> None:
        self._arm, self._clock, self._wrist, self._trajectory = arm, clock, wrist, trajectory
        self._limits = limits
        self._began = clock.now()
        self._initial = None if wrist is None else np.linalg.norm(wrist.contact().force)
        self._in_a_row = 0

    def objection(self) -> str | None:
        """Return the contact as text, or None."""
        found = self._force() or self._lag()
        self._in_a_row = self._in_a_row + 1 if found else 0
        return found if self._in_a_row >= self._limits.samples else None

    def _force(self) -> str | None:
        if self._wrist is None or self._initial is None:
            return None
        force = float(np.linalg.norm(self._wrist.contact().force) - self._initial)
        if force <= self._limits.force:
            return None
        return f"unexpected contact: {force:.0f} N at the wrist"

    def _lag(self) -> str | None:
        if self._trajectory is None:
            return None
        p, passed = self._limits, self._arm.trajectory_time()
        if passed is None:
            passed = self._clock.now() - self._began
        latency = max(p.latency, self._arm.latency)
        now, before = (self._trajectory.sample(max(0.0, t))[0] for t in (passed, passed - latency))
        measured = self._arm.positions()
        # Anywhere between the two set-points is no lag.
        lag = np.maximum(np.minimum(now, before) - measured, measured - np.maximum(now, before))
        worst = int(np.argmax(lag))
        if lag[worst] <= p.lag:
            return None
        joint = self._arm.joint_names[worst]
        return f"unexpected contact: {joint} is {lag[worst]:.3f} rad off its way"


LOOKS = 12
"""Number of positions along a path at which the arm is drawn for a person."""
Guard = Callable[[], str | None]
Result = TypeVar("Result")


class _Streaming(Protocol):
    def tick(self) -> bool:
        """Run one control period; return False when the motion is over."""


@dataclass(frozen=True)
class ArmMoving:
    """Parameters of arm motions. ``guard_period``: seconds between two calls of a guard."""

    guard_period: float = 0.05
    contact: ContactLimits = field(default_factory=ContactLimits)
    streaming: Streaming = field(default_factory=Streaming)
    guarded: Guarding = field(default_factory=Guarding)
    following: Following = field(default_factory=Following)


class ArmController:
    """Runs motions of one arm. The arm's driver monitors tracking; guards monitor further conditions.

    A guard is called periodically while the arm moves; if it returns a text, the arm is brought to rest and the motion
    fails with that text. ``kinematics`` and ``wrist``: for ``move_until`` and ``follow_constraint``. ``coordinator``:
    shared by the controllers of a robot's arms; a motion that would cross another arm's path waits for it, or fails as
    OTHER_ARM_IN_THE_WAY. ``confirm``: asks a person before each motion, which fails as DECLINED if refused; ``bodies``:
    from joint positions to the corners (N, 3), metres in the map frame, of the bodies that move with the arm, to show
    to the person.
    """

    def __init__(
        self,
        arm: Arm,
        clock: Clock,
        kinematics: InverseKinematics | None = None,
        wrist: WristWrench | None = None,
        coordinator: ArmCoordinator | None = None,
        moving: ArmMoving = ArmMoving(),
        confirm: Confirm | None = None,
        bodies: Callable[[NDArray[np.float64]], list[NDArray[np.float64]]] | None = None,
    ) -> None:
        self._confirm, self._bodies = confirm, bodies
        self._arm, self.name, self.joint_names = arm, arm.name, arm.joint_names
        self._clock = clock
        self._kinematics, self._wrist, self._moving = kinematics, wrist, moving
        self._stream: _Stream | None = None
        self._coordinator = coordinator

    def positions(self) -> NDArray[np.float64]:
        """Return the measured positions, (n,) radians."""
        return self._arm.positions()

    def carry(self, mass: float, centre: ArrayLike) -> None:
        """Set the payload in the hand: kg (0: none), and its centre (3,) in the tool frame."""
        self._arm.carry(mass, centre)

    def follow(self, trajectory: JointTrajectory, guard: Guard | None = None, free: bool = False) -> Motion[None]:
        """Follow a trajectory from the current positions; succeeds when the arm rests at its end.

        ``free``: no contact is expected; a contact ends it as COLLISION.
        """
        self._end_stream(MotionErrorCode.SUPERSEDED, "a newer command took over")

        def start() -> Motion[None]:
            motion: Motion[None] = start_motion(self._arm.name, lambda: self._arm.follow(trajectory))
            return self._watched(motion, guard, trajectory if free else None)

        def planned() -> PlannedMotion:
            words = f"along a trajectory to {self._in_words(trajectory.positions[-1])}"
            return self._planned(trajectory.positions, words, trajectory.duration)

        return self._in_turn(start, lambda: trajectory.positions, planned)

    def move_to(self, positions: ArrayLike, speed_scale: float = 0.3, guard: Guard | None = None) -> Motion[None]:
        """Move point to point to ``positions`` (n,) within a fraction of the limits; no collision check."""
        self._end_stream(MotionErrorCode.SUPERSEDED, "a newer command took over")

        def start() -> Motion[None]:
            motion: Motion[None] = start_motion(self._arm.name, lambda: self._arm.move_to(positions, speed_scale))
            return self._watched(motion, guard, None)

        def path() -> NDArray[np.float64]:
            return np.vstack([self._arm.positions(), np.asarray(positions, float)])

        def planned() -> PlannedMotion:
            way = path()
            return self._planned(way, f"straight in joint space to {self._in_words(way[-1])}")

        return self._in_turn(start, path, planned)

    def move_until(
        self, direction: ArrayLike, speed: float, max_distance: float, stop_force: float
    ) -> Motion[GuardedOutcome]:
        """Move the tool straight along ``direction`` (3,), base frame, until the resistance reaches ``stop_force`` N.

        Reaching ``max_distance`` metres without contact is also a success; the outcome distinguishes the two. The hand
        keeps its orientation. Fails as UNREACHABLE if the arm cannot continue. Raises ValueError for invalid values.
        """
        axis = _unit(direction)
        check_positive(speed=speed, max_distance=max_distance, stop_force=stop_force)
        kinematics, wrist = self._feeling("move_until")
        motion: Motion[GuardedOutcome] = Motion(self._arm.name, self._cancel_stream)
        stream = ToolStream(self._arm, kinematics, self._moving.streaming)
        move = GuardedMove(stream, wrist, axis, speed, max_distance, stop_force, motion, self._moving.guarded)
        words = f"straight on along {np.round(axis, 2).tolist()} until {stop_force:g} N, at most {max_distance:.3f} m"
        return self._run(move, motion, words)

    def follow_constraint(
        self,
        direction: ArrayLike,
        goal: FollowGoal,
        grip: Guard | None = None,
        hint: JointKind | None = None,
    ) -> Motion[FollowedMotion]:
        """Follow a door or drawer whose handle the hand holds, or that it pushes.

        ``direction``: (3,) base frame, expected initial direction of the handle. ``grip``: returns a text when the
        handle is lost (``GripperController.watch_slip``). ``hint``: the kind of joint, if known. The result, also of a
        failed motion, is a FollowedMotion. Raises ValueError for a zero direction.
        """
        start = _unit(direction)
        kinematics, wrist = self._feeling("follow_constraint")
        motion: Motion[FollowedMotion] = Motion(self._arm.name, self._cancel_stream)
        stream = ToolStream(self._arm, kinematics, self._moving.streaming)
        following = ConstraintFollowing(stream, wrist, start, goal, motion, grip, hint, self._moving.following)
        return self._run(following, motion, "along with the handle that it holds")

    def stop(self) -> None:
        """Stop the arm immediately."""
        self._end_stream(MotionErrorCode.STOPPED, "the arm was stopped")
        if self._coordinator is not None:
            self._coordinator.end_waiting(self.name, MotionErrorCode.STOPPED, "the arm was stopped")
        self._arm.stop()

    def _feeling(self, what: str) -> tuple[InverseKinematics, WristWrench]:
        if self._kinematics is None or self._wrist is None:
            raise ValueError(f"{what} needs an arm controller with kinematics and a wrist force-torque sensor")
        return self._kinematics, self._wrist

    def for_planning(self, joints: Mapping[str, float]) -> Mapping[str, float]:
        """Return ``joints``, measured positions by name, with other moving arms at their targets."""
        return joints if self._coordinator is None else self._coordinator.for_planning(self.name)

    def _run(self, action: _Streaming, motion: Motion[Result], words: str) -> Motion[Result]:
        self._end_stream(MotionErrorCode.SUPERSEDED, "a newer command took over")

        def start() -> Motion[Result]:
            self._arm.stop()  # also ends a motion under way
            self._stream = _Stream(action, motion, self._arm)
            self._stream.start(self._clock, self._moving.streaming.period)
            return motion

        return self._in_turn(start, None, lambda: PlannedMotion(self.name, words))

    def _in_words(self, positions: NDArray[np.float64]) -> str:
        return ", ".join(f"{joint} {value:.2f}" for joint, value in zip(self.joint_names, positions, strict=False))

    def _in_turn(
        self,
        start: Callable[[], Motion[Result]],
        path: Callable[[], NDArray[np.float64]] | None,
        planned: Callable[[], PlannedMotion],
    ) -> Motion[Result]:
        if (refused := declined(self._confirm, planned)) is not None:
            return refused
        if self._coordinator is None:
            return start()
        return self._coordinator.start(self.name, None if path is None else path(), start)

    def _planned(self, way: NDArray[np.float64], words: str, duration: float | None = None) -> PlannedMotion:
        if self._bodies is None:
            return PlannedMotion(self.name, words, duration)
        at, samples = np.linspace(0.0, len(way) - 1.0, LOOKS), np.arange(len(way))
        looks = np.stack([np.interp(at, samples, joint) for joint in way.T], axis=1)
        corners = np.concatenate([corner for positions in looks for corner in self._bodies(positions)])
        heights = float(corners[:, 2].min()), float(corners[:, 2].max())
        return PlannedMotion(self.name, words, duration, (outline(corners[:, :2]),), heights)

    def _cancel_stream(self) -> None:
        self.stop()

    def _end_stream(self, code: MotionErrorCode, text: str) -> None:
        if self._stream is not None:
            self._stream.end(Failure(code, text))
            self._stream = None

    def _watched(self, motion: Motion[None], guard: Guard | None, free: JointTrajectory | None) -> Motion[None]:
        if free is not None and not motion.done:
            monitor = ContactMonitor(self._arm, self._clock, self._wrist, free, self._moving.contact)
            watch = _Watch(motion, monitor.objection, self._arm, MotionErrorCode.COLLISION)
            watch.start(self._clock, self._moving.contact.period)
        if guard is not None and not motion.done:
            _Watch(motion, guard, self._arm).start(self._clock, self._moving.guard_period)
        return motion


class _Watch:
    """Asks a guard until the action has ended."""

    def __init__(
        self,
        motion: Motion[None],
        guard: Guard,
        arm: Arm,
        code: MotionErrorCode = MotionErrorCode.GUARDED,
    ) -> None:
        self._motion, self._guard, self._arm, self._code = motion, guard, arm, code
        self._timer: Timer | None = None

    def start(self, clock: Clock, period: float) -> None:
        self._timer = clock.every(period, self._tick)

    def _tick(self) -> None:
        failure: Failure | None = None
        try:
            if not self._motion.done and (objection := self._guard()) is not None:
                failure = Failure(self._code, objection)
        except READING_ERRORS as error:
            failure = error.failure
        if failure is not None:
            self._motion.end(MotionStatus.FAILED, failure)
            self._arm.stop()
        if self._motion.done and self._timer is not None:
            self._timer.cancel()


class _Stream:
    """Calls a streaming action every period until it is over, and then stops the arm."""

    def __init__(self, action: _Streaming, motion: Motion[Any], arm: Arm) -> None:
        self._action, self._motion, self._arm = action, motion, arm
        self._timer: Timer | None = None

    def start(self, clock: Clock, period: float) -> None:
        self._timer = clock.every(period, self._tick)

    def end(self, failure: Failure) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._motion.end(MotionStatus.CANCELED, failure)

    def _tick(self) -> None:
        try:
            going = self._action.tick()
        except RobotStoppedError as error:
            self.end(error.failure)
            return
        except (CommandRefusedError, *READING_ERRORS) as error:
            self._motion.end(MotionStatus.FAILED, error.failure)
            going = False
        if not going:
            if self._timer is not None:
                self._timer.cancel()
            self._arm.stop()


def _unit(direction: ArrayLike) -> NDArray[np.float64]:
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)) or float(np.linalg.norm(vector)) < 1e-6:
        raise ValueError(f"direction should be three finite numbers, not all zero, but is {direction!r}")
    unit: NDArray[np.float64] = vector / np.linalg.norm(vector)
    return unit
