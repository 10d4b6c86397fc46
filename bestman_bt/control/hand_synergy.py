"""Hands of many fingers, closed by one number.

M. Santello et al., "Postural hand synergies for tool use", 1998: the first of them opens and closes all fingers
together. Each finger yields where something blocks it, as the soft synergies of M. Gabiccini et al. (2011) do: its
joints are springs of bounded torque that pull to the synergy's posture.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.messages import Failure, MotionErrorCode
from hal.api import Clock, CommandRefusedError, JointGroup, Motion, MotionStatus, NotConnectedError, Timer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SynergyParameters:
    """``stiffness``: N m/rad and ``damping``: N m s/rad of the joints; ``speed``: of the closure, 1/s.

    ``lever``: metres by which a force at a finger tip becomes the torque of its joints. ``settled``: rad/s below which
    joints count as at rest for ``settle_time`` seconds; ``blocked``: radians that the joints of a closed hand are off
    in the mean when it holds something. ``timeout``: seconds. ``period``: between two torques.
    """

    stiffness: float = 2.0
    damping: float = 0.05
    speed: float = 1.0
    lever: float = 0.09
    settled: float = 0.15
    settle_time: float = 0.1
    blocked: float = 0.05
    timeout: float = 4.0
    period: float = 1.0 / 240.0


@dataclass(frozen=True)
class HandOutcome:
    """``closure`` of the joints in the mean, 0 open to 1 closed; whether something keeps them from the target."""

    closure: float
    object_held: bool


class HandSynergy:
    """Moves a hand between two postures, ``opened`` and ``closed`` (n,), by its closure from 0 to 1."""

    def __init__(
        self,
        hand: JointGroup,
        clock: Clock,
        opened: ArrayLike,
        closed: ArrayLike,
        parameters: SynergyParameters | None = None,
    ) -> None:
        self._hand, self._clock = hand, clock
        self._opened, self._closed = np.asarray(opened, float), np.asarray(closed, float)
        if self._opened.shape != (len(hand.joint_names),) or self._closed.shape != self._opened.shape:
            message = f"{hand.name} has {len(hand.joint_names)} joints, the postures have {self._opened.shape}"
            raise ValueError(f"{message} and {self._closed.shape} positions")
        self._parameters = parameters or SynergyParameters()
        self._limits = hand.model.effort
        self._closure = self._target = 0.0
        self._torque: Array = self._limits
        self._still_for = self._running_for = 0.0
        self._timer: Timer | None = None
        self._motion: Motion[HandOutcome] | None = None

    def closure(self) -> float:
        """How far the hand is closed by its encoders, 0 to 1: the projection on the way from open to closed."""
        way = self._closed - self._opened
        return float((self._hand.positions() - self._opened) @ way / (way @ way))

    def close(self, force: float | None = None) -> Motion[HandOutcome]:
        """Close until all fingers are blocked or closed; ``force``: newtons that a finger tip may press with."""
        return self.move(1.0, force)

    def open(self) -> Motion[HandOutcome]:
        """Open fully."""
        return self.move(0.0)

    def move(self, closure: float, force: float | None = None) -> Motion[HandOutcome]:
        """Move to a closure; being blocked by an object is success. ValueError for what makes no sense.

        The joints go on pressing once the action has ended, until ``stop`` or another command.
        """
        if not 0.0 <= closure <= 1.0:
            raise ValueError(f"the closure of {self._hand.name} should be within 0 and 1, got {closure}")
        if force is not None and not force > 0.0:
            raise ValueError(f"the force of {self._hand.name} should be above 0 N, got {force}")
        if self._motion is not None:
            self._motion.abort(MotionErrorCode.SUPERSEDED, "a newer command took over")
        torque = self._limits if force is None else np.full(len(self._limits), force * self._parameters.lever)
        self._torque = np.minimum(torque, self._limits)
        self._closure = min(1.0, max(0.0, self.closure())) if self._timer is None else self._closure
        self._target, self._still_for, self._running_for = closure, 0.0, 0.0
        self._motion = Motion(self._hand.name, self.stop)
        if self._timer is None:
            self._timer = self._clock.every(self._parameters.period, self._tick)
        self._tick()
        return self._motion

    def stop(self) -> None:
        """Hold where the fingers are."""
        self._end(Failure(MotionErrorCode.STOPPED, f"{self._hand.name} was stopped"))
        self._hand.stop()

    def _tick(self) -> None:
        p = self._parameters
        step = p.speed * p.period
        self._closure += min(step, max(-step, self._target - self._closure))
        wanted = self._opened + self._closure * (self._closed - self._opened)
        try:
            positions, speeds = self._hand.positions(), self._hand.velocities()
            spring = np.clip(p.stiffness * (wanted - positions), -self._torque, self._torque)
            self._hand.command(efforts=np.clip(spring - p.damping * speeds, -self._limits, self._limits))
        except (CommandRefusedError, NotConnectedError) as error:
            self._end(replace(error.failure, code=MotionErrorCode.STOPPED))
            return
        self._watch(wanted, positions, speeds)

    def _watch(self, wanted: Array, positions: Array, speeds: Array) -> None:
        p, motion = self._parameters, self._motion
        if motion is None or motion.done:
            return
        self._running_for += p.period
        arrived = self._closure == self._target and float(np.abs(speeds).max()) < p.settled
        self._still_for = self._still_for + p.period if arrived else 0.0
        if self._still_for >= p.settle_time:
            off = float(np.abs(wanted - positions).mean())
            motion.succeed(HandOutcome(self.closure(), off > p.blocked))
        elif self._running_for > p.timeout:
            motion.fail(MotionErrorCode.TIMEOUT, f"the fingers of {self._hand.name} do not come to rest")

    def _end(self, failure: Failure) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._motion is not None:
            self._motion.end(MotionStatus.CANCELED, failure)
