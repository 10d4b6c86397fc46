"""Grippers over a channel: width and standstill show whether an object is held."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bestman_bt.robot_model.model import GripperModel
from hal.api import Failure, Gripper, GripperState, Motion, MotionErrorCode, MotionStatus
from hal.parts.channels import GripperChannel, GripperReading, StoppablePart
from hal.parts.part_connection import refusal
from hal.parts.stop_latch import StopLatch

SETTLED = 0.05
"""Seconds that the width has to stay at its target."""


@dataclass(frozen=True)
class Gripping:
    """Criteria for reached targets and held objects. Metres, newtons, m/s (rate of the width), seconds.

    ``usual_force`` and ``usual_speed``: defaults of commands. ``at_target``: tolerance of the width. Closing fingers
    that stay within ``still_band`` for ``still_time`` are blocked by an object if they are more than ``blocked_margin``
    from their target; if the gripper senses objects and senses none, they are stuck after ``unfelt_time``.
    ``spare_time``: extra time of a motion beyond its nominal duration.
    """

    usual_force: float = 40.0
    usual_speed: float = 0.2
    at_target: float = 0.0015
    blocked_margin: float = 0.002
    still_band: float = 0.0005
    still_time: float = 0.2
    unfelt_time: float = 1.0
    spare_time: float = 3.0


class CommandedGripper(StoppablePart, Gripper):
    """A gripper over a channel. A loop of the connection calls ``cycle``; only ``cycle`` uses the channel."""

    def __init__(
        self,
        name: str,
        model: GripperModel,
        channel: GripperChannel,
        latch: StopLatch,
        gripping: Gripping = Gripping(),
    ) -> None:
        super().__init__(name, latch)
        self.model, self._channel = model, channel
        self._gripping = gripping
        self._checks = GripperCommandChecks(name, model, gripping.usual_force, gripping.usual_speed)
        self._reading: GripperReading | None = None
        self._order: tuple[float, float, float] | None = None  # width, force, speed that are still to be sent
        self._sent: tuple[float, float, float] | None = None  # of the motion under way, at full speed
        self._share = 1.0  # of the speed, at which it was sent
        self._halting = False
        self._target = model.max_width
        self._closing = self._blocked = False
        self._time = self._still_for = self._limit = self._anchor = 0.0

    def width(self) -> float:
        """Return the measured opening, metres."""
        self._connection.check_reading()
        assert self._reading is not None  # ``attach`` has read it
        return self._reading.width

    def state(self) -> GripperState:
        """Return the state from the encoder and, if available, the gripper's own object detection."""
        width = self.width()
        with self._connection.lock:
            moving = self._connection.motion is not None
            at_target = abs(width - self._target) < self._gripping.at_target
            held = self._blocked and not moving and width > self._target + self._gripping.blocked_margin
            return GripperState(moving, at_target, held, self._closing and at_target and not moving)

    def move(self, width: float, force: float | None = None, speed: float | None = None) -> Motion[None]:
        """Open or close to ``width`` at ``speed`` (rate of the width); being blocked by an object is success."""
        model = self.model
        with self._connection.lock:
            self._connection.check_command("move")
            width, force, speed = self._checks.move(width, force, speed)
            present = self.width()
            motion: Motion[None] = Motion(self.name, self._halt)
            self._connection.begin(motion)
            self._closing, self._blocked, self._halting = width < present, False, False
            self._target = float(np.clip(width, model.part.min_width, model.max_width))
            self._time, self._still_for, self._anchor = 0.0, 0.0, present
            self._limit = abs(present - width) / speed + self._gripping.spare_time
            self._order = (self._target, force, speed)
            return motion

    def brake(self) -> None:
        """Halt the fingers; an existing grasp keeps pressing."""
        with self._connection.lock:
            if self._connection.motion is not None:
                self._halt()

    def attach(self) -> None:
        """Set the target to the current width."""
        with self._connection.lock:
            self._channel.refresh()
            self._reading = self._channel.read()
            self._target = self._reading.width
            self._closing = self._blocked = self._halting = False
            self._order = None
            self._connection.open()

    @property
    def resting(self) -> bool:
        """Return whether no command is pending."""
        return not self._halting and self._order is None

    @property
    def traced(self) -> tuple[str, ...]:
        """Return the names of the widths, and of the held flag."""
        return "set width", "measured width", "held"

    def fail(self, fault: Failure) -> None:
        """Fail the current motion."""
        with self._connection.lock:
            self._connection.fail_motion(fault)
            self._order = None

    def cycle(self, elapsed: float) -> None:
        """Run one control period: send pending commands, and check the progress of the fingers."""
        with self._connection.lock:
            order, halting, share = self._order, self._halting, self.speed_share
            self._order, self._halting = None, False
            if order is None and not halting and share != self._share and self._connection.motion is not None:
                order = self._sent  # again, at another speed
            self._sent, self._share = order or self._sent, share
        if halting or (order is not None and share == 0.0):
            self._channel.halt()
        elif order is not None:
            width, force, speed = order
            self._channel.send(width, force, speed * share)
        silent = self._channel.refresh() is False
        reading = self._channel.read()
        row = None if self.trace is None else self.trace.row()
        if row is not None:
            row[:] = self._target, reading.width, self._blocked
        with self._connection.lock:
            self._reading = reading
            if self._order is not None:
                return  # commanded during this cycle: the reading is of the time before, the next cycle sends it
            if halting:
                self._target = reading.width
            self._watch(reading, elapsed * share, silent)

    def _halt(self) -> None:
        """Halt the fingers unless they press on an object; fingers that have not begun to move yet are not blocked."""
        gripping = self._gripping
        with self._connection.lock:
            if self._time <= self._channel.reaction_time or self._still_for < gripping.still_time / 3:
                self._halting = True  # the next cycle halts, whatever was to be sent

    def _watch(self, reading: GripperReading, elapsed: float, silent: bool) -> None:
        gripping, motion = self._gripping, self._connection.motion
        if motion is None:
            # Fingers that press tremble; only when they have closed, the object is gone. What the gripper feels itself
            # may come back: a seal that was broken for an instant.
            felt = self._closing and bool(reading.object_held)
            self._blocked = (self._blocked or felt) and reading.width > self._target + gripping.blocked_margin
            return
        self._still_for += 0.0 if silent else elapsed
        if abs(reading.width - self._anchor) > gripping.still_band:
            self._anchor, self._still_for = reading.width, 0.0
        self._time += elapsed
        reacting = self._time <= self._channel.reaction_time + gripping.still_time
        if abs(reading.width - self._target) < gripping.at_target and self._still_for > SETTLED:
            motion.succeed()
        elif reading.object_held or (self._still_for >= gripping.still_time and not reacting):
            unfelt = self._closing and reading.object_held is False
            if unfelt and self._still_for < gripping.unfelt_time:
                return
            self._blocked = self._closing and not unfelt
            if self._blocked:
                motion.succeed()
            else:
                self._give_up(reading, MotionErrorCode.FAULT, "is stuck")
        elif self._time > self._limit:
            self._give_up(reading, MotionErrorCode.TIMEOUT, "does not answer" if silent else "is too slow")

    def _give_up(self, reading: GripperReading, code: MotionErrorCode, what: str) -> None:
        text = f"{what}: the width is {reading.width:.4f} m, asked were {self._target:.4f} m"
        self._connection.end_motion(MotionStatus.FAILED, code, text)


class GripperCommandChecks:
    """The ranges of a gripper and the checks of its commands, which raise CommandRefusedError.

    ``usual_force`` (N) and ``usual_speed`` (m/s, rate of the width): defaults of commands; by default, and at most, the
    gripper's maximum.
    """

    def __init__(
        self,
        part_name: str,
        model: GripperModel,
        usual_force: float = math.inf,
        usual_speed: float = math.inf,
    ) -> None:
        self._part_name, self._model = part_name, model
        self._usual_force = min(usual_force, model.part.max_force)
        self._usual_speed = min(usual_speed, model.part.max_speed)

    def move(self, width: float, force: float | None, speed: float | None) -> tuple[float, float, float]:
        """Return width, force and speed (m, N, m/s). Raises CommandRefusedError outside the ranges."""
        part = self._model.part
        force = self._usual_force if force is None else force
        speed = self._usual_speed if speed is None else speed
        for what, value, lower, upper, unit in (
            ("width", width, part.min_width - 1e-9, self._model.max_width + 1e-9, "m"),
            ("force", force, 1e-9, part.max_force, "N"),
            ("speed", speed, 1e-9, part.max_speed, "m/s"),
        ):
            if not (math.isfinite(value) and lower <= value <= upper):
                why = f"{what} = {value} {unit} is not within [{max(lower, 0.0):.4g}, {upper:.4g}] {unit}"
                raise refusal(self._part_name, "move", why)
        return float(width), float(force), float(speed)
