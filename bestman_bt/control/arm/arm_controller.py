"""Arms: follow trajectories and move point to point, under watch."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.control.handle import ControlErrorCode, ControlHandle
from bestman_bt.control.motion_handle import start_motion
from bestman_bt.messages import JointTrajectory
from hal.api import Arm, Clock, JointLimits, Timer

Guard = Callable[[], str | None]


class ArmController:
    """Runs motions of one arm. The arm's driver watches that it tracks; a guard can watch for anything else.

    A guard is asked every ``guard_period`` seconds while the arm moves; when it answers with a text, the arm is
    brought to rest and the handle fails with that text.
    """

    def __init__(self, arm: Arm, clock: Clock, guard_period: float = 0.05) -> None:
        self._arm = arm
        self._clock = clock
        self._guard_period = guard_period

    @property
    def name(self) -> str:
        """The arm's name in its robot."""
        return self._arm.name

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints."""
        return self._arm.joint_names

    @property
    def limits(self) -> tuple[JointLimits, ...]:
        """Limits of the n joints."""
        return self._arm.limits

    def positions(self) -> NDArray[np.float64]:
        """Measured positions, (n,) radians."""
        return self._arm.positions()

    def follow(self, trajectory: JointTrajectory, guard: Guard | None = None) -> ControlHandle[None]:
        """Follow a trajectory that starts where the arm is; succeeds when the arm rests at its end."""
        return self._watched(start_motion(lambda: self._arm.follow(trajectory)), guard)

    def move_to(
        self, positions: ArrayLike, speed_scale: float = 0.3, guard: Guard | None = None
    ) -> ControlHandle[None]:
        """Move point to point to ``positions`` (n,) within a share of the limits; no collision check."""
        return self._watched(start_motion(lambda: self._arm.move_to(positions, speed_scale)), guard)

    def stop(self) -> None:
        """Bring the arm to rest at once."""
        self._arm.stop()

    def _watched(self, handle: ControlHandle[None], guard: Guard | None) -> ControlHandle[None]:
        if guard is not None and not handle.done:
            _Watch(handle, guard, self._arm).start(self._clock, self._guard_period)
        return handle


class _Watch:
    """Asks a guard until the action has ended."""

    def __init__(self, handle: ControlHandle[None], guard: Guard, arm: Arm) -> None:
        self._handle, self._guard, self._arm = handle, guard, arm
        self._timer: Timer | None = None

    def start(self, clock: Clock, period: float) -> None:
        self._timer = clock.every(period, self._tick)

    def _tick(self) -> None:
        objection = None if self._handle.done else self._guard()
        if objection is not None:
            self._handle.fail(ControlErrorCode.GUARDED, objection)
            self._arm.stop()
        if self._handle.done and self._timer is not None:
            self._timer.cancel()
