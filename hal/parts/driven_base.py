"""Mobile bases over a channel: velocities within limits, with a timeout; distances and turns by odometry."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass

import numpy as np

from bestman_bt.messages import Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.part_config import BasePart, MobilePart
from hal.api import Failure, MobileBase, Motion, MotionErrorCode, MotionStatus, NoDataError
from hal.parts.channels import BaseChannel, BaseReading, ControlledPart
from hal.parts.part_connection import PartConnection, refusal
from hal.parts.stop_latch import StopLatch

STILL = Twist2D(0.0, 0.0, 0.0)
HEADING_GAIN = 2.0
"""Turning speed per radian off the straight line, 1/s."""


@dataclass(frozen=True)
class Arrival:
    """The end of a motion: the target is reached within ``arrived`` (m or rad) for ``near_time`` seconds.

    The speed is at most the root of ``braking_share`` × acceleration × remainder (2 would be full braking, less leaves
    room for the base's lag), and ``approach_rate`` (1/s) × remainder.
    """

    arrived: float = 0.002
    near_time: float = 0.1
    braking_share: float = 1.4
    approach_rate: float = 4.0


@dataclass(frozen=True)
class BaseTiming:
    """Times of a base. ``command_timeout``: seconds until ``set_velocity`` expires. ``stop_time``: longest braking,
    seconds.

    ``rest_repeats``: number of zero velocities sent after the base has come to rest.
    """

    command_timeout: float = 0.25
    stop_time: float = 0.3
    rest_repeats: int = 20
    arrival: Arrival = Arrival()


class DrivenBase(ControlledPart, MobileBase):
    """A base over a channel. A loop of the connection calls ``cycle`` once per control period."""

    def __init__(
        self,
        name: str,
        model: BaseModel,
        channel: BaseChannel,
        latch: StopLatch,
        timing: BaseTiming = BaseTiming(),
    ) -> None:
        super().__init__(name)
        self.model, self._channel = model, channel
        self._timing, self.command_timeout = timing, timing.command_timeout
        self._checks = BaseCommandChecks(name, model)
        self._connection = PartConnection(name, latch)
        self._wanted = self._sent = STILL
        self._braking = False
        self._lapses_in = 0.0
        self._share = 1.0  # of the wanted velocity, on the way to ``speed_share``
        self._profile: MotionProfile | None = None
        self._silent_after = 0
        self._reading: BaseReading | None = None

    def odometry(self) -> Pose2D:
        """Return the pose in the odom frame, as reported by the base."""
        self._connection.check_reading()
        return self._read().odometry

    def velocity(self) -> Twist2D:
        """Return the velocity in the base frame, as reported by the base."""
        self._connection.check_reading()
        return self._read().velocity

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity, approached within the acceleration limits; expires after ``command_timeout``."""
        with self._connection.lock:
            self._connection.check_command("set_velocity")
            velocity = self._checks.velocity(vx, vy, wz)
            self._connection.begin(None)
            self._profile, self._braking = None, False
            self._wanted = velocity
            self._lapses_in = self.command_timeout

    def move_forward(self, distance: float) -> Motion[None]:
        """Drive straight ahead by odometry."""
        return self._go("move_forward", distance, 1.0)

    def move_backward(self, distance: float) -> Motion[None]:
        """Drive straight back by odometry."""
        return self._go("move_backward", distance, -1.0)

    def rotate(self, angle: float) -> Motion[None]:
        """Turn in place by odometry; an angle beyond a full turn is executed in full."""
        with self._connection.lock:
            self._connection.check_command("rotate")
            angle = self._checks.angle("rotate", angle)
            return self._start(turn=angle)

    def stop(self) -> None:
        """Brake to rest within half a second, ending the current motion."""
        with self._connection.lock:
            if self._connection.connected:
                self._halt(hard=True)
                self._connection.stop_motion()

    def brake(self) -> None:
        """Brake to rest within the acceleration limits."""
        with self._connection.lock:
            self._halt(hard=False)

    def attach(self) -> None:
        """Send zero velocity: the base may still execute the last command of an earlier connection."""
        with self._connection.lock:
            self._wanted = self._sent = STILL
            self._profile, self._silent_after = None, self._timing.rest_repeats
            self._connection.open()

    def detach(self) -> None:
        """Brake before the controller disconnects."""
        with self._connection.lock:
            self._halt(hard=True)
            self._connection.close()

    @property
    def resting(self) -> bool:
        """Return whether the base is commanded to stand still."""
        return self._wanted == self._sent == STILL

    def fail(self, fault: Failure) -> None:
        """Fail the current motion and command the base to stop, if it is reachable."""
        with self._connection.lock:
            self._connection.fail_motion(fault)
            self._halt(hard=True)

    def cycle(self, elapsed: float) -> None:
        """Run one control period, ``elapsed`` seconds after the last one: send the next velocity if one is due."""
        self._record()
        with self._connection.lock:
            self._decide(elapsed)
            rest = self._wanted == self._sent == STILL
            self._silent_after = self._silent_after - 1 if rest else self._timing.rest_repeats
            if rest and self._silent_after < 0:
                self._silent_after, self._share = 0, self.speed_share
                return
            velocity = self._approached(elapsed)
        taken = self._channel.send(velocity)
        with self._connection.lock:
            if taken:
                self._sent = velocity

    @property
    def traced(self) -> tuple[str, ...]:
        """Return the column names of velocities and odometry; measurements are the latest readings."""
        return (
            *(f"{what} {axis}" for what in ("asked", "set", "measured") for axis in ("vx", "vy", "wz")),
            *(f"measured {what}" for what in ("x", "y", "heading")),
        )

    def _record(self) -> None:
        row = None if self.trace is None else self.trace.row()
        if row is not None:
            wanted, sent, reading = self._wanted, self._sent, self._reading
            row[:6] = wanted.vx, wanted.vy, wanted.wz, sent.vx, sent.vy, sent.wz
            row[6:] = (*astuple(reading.velocity), *astuple(reading.odometry)) if reading is not None else np.nan

    def _read(self) -> BaseReading:
        self._reading = self._channel.read()
        return self._reading

    def _go(self, command: str, distance: float, direction: float) -> Motion[None]:
        with self._connection.lock:
            self._connection.check_command(command)
            distance = self._checks.distance(command, distance)
            return self._start(distance=direction * distance)

    def _start(self, *, distance: float = 0.0, turn: float = 0.0) -> Motion[None]:
        start = self._read().odometry
        profile = MotionProfile(self.model.part, start, self._timing.arrival, distance=distance, turn=turn)
        motion: Motion[None] = Motion(self.name, self.brake)
        self._connection.begin(motion)
        self._profile, self._braking = profile, False
        return motion

    def _decide(self, elapsed: float) -> None:
        if self._profile is None:
            self._lapses_in -= elapsed
            if self._lapses_in < 0.0:
                self._wanted = STILL
            return
        profile, motion = self._profile, self._connection.motion
        try:
            odometry = self._read().odometry
        except NoDataError as error:
            self._halt(hard=False)
            self._connection.fail_motion(error.failure)
            return
        self._wanted = profile.velocity(odometry, elapsed * self._share)
        if profile.arrived:
            self._halt(hard=False)
            if motion is not None:
                motion.succeed()
        elif profile.overdue:
            self._halt(hard=False)
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, profile.remainder())

    def _halt(self, hard: bool) -> None:
        self._profile, self._braking = None, hard
        self._wanted, self._lapses_in = STILL, 0.0

    def _approached(self, elapsed: float) -> Twist2D:
        """Return the velocity next to the last one on the way to the wanted one, within the acceleration limits."""
        limits, sent = self.model.part, self._sent
        linear, angular = limits.max_acceleration, limits.max_angular_acceleration
        # All velocities alike, and no faster than the base can follow, so that the curvature stays.
        change = elapsed * min(linear / limits.max_vx, angular / limits.max_wz)
        self._share = min(max(self.speed_share, self._share - change), self._share + change)
        wanted = Twist2D(*(self._share * value for value in (self._wanted.vx, self._wanted.vy, self._wanted.wz)))
        if self._braking:
            linear = max(linear, limits.max_vx / self._timing.stop_time)
            angular = max(angular, limits.max_wz / self._timing.stop_time)
        dx, dy, dw = wanted.vx - sent.vx, wanted.vy - sent.vy, wanted.wz - sent.wz
        if isinstance(limits, BasePart) and limits.steering_joints:  # in one stride: the wheels keep pointing one way
            step, turn = linear * elapsed, angular * elapsed
            share = min(1.0, step / max(math.hypot(dx, dy), 1e-9), turn / max(abs(dw), 1e-9))
            if share == 1.0:
                return wanted
            return Twist2D(sent.vx + share * dx, sent.vy + share * dy, sent.wz + share * dw)

        def towards(value: float, goal: float, step: float) -> float:
            return value + min(max(goal - value, -step), step)

        return Twist2D(
            towards(sent.vx, wanted.vx, linear * elapsed),
            towards(sent.vy, wanted.vy, linear * elapsed),
            towards(sent.wz, wanted.wz, angular * elapsed),
        )


class MotionProfile:
    """A straight motion of ``distance`` metres (negative: back) or a ``turn`` in radians (counter-clockwise), from
    ``start``.
    """

    def __init__(
        self,
        limits: MobilePart,
        start: Pose2D,
        arrival: Arrival,
        *,
        distance: float = 0.0,
        turn: float = 0.0,
    ) -> None:
        self._arrival = arrival
        self._limits, self._start, self._distance, self._turn = limits, start, distance, turn
        self._heading, self._turned = start.theta, 0.0
        self._remaining = turn or distance
        if turn:
            limit, acceleration = limits.max_wz, limits.max_angular_acceleration
        else:
            limit, acceleration = limits.max_vx, limits.max_acceleration
        self._limit, self._acceleration = limit, acceleration
        self._time_left = 2.0 * (abs(self._remaining) / limit + limit / acceleration) + 3.0
        self._near_for = 0.0
        self.arrived = turn == 0.0 and distance == 0.0

    @property
    def overdue(self) -> bool:
        """Return whether the motion takes more than twice its planned time."""
        return self._time_left < 0.0

    def remainder(self) -> str:
        """Return the remaining distance or angle, as text."""
        return f"{self._remaining:.3f} {'rad' if self._turn else 'm'} remain at the end of the planned time"

    def velocity(self, odometry: Pose2D, elapsed: float) -> Twist2D:
        """Return the velocity to drive at, ``elapsed`` seconds after the last call."""
        self._time_left -= elapsed
        self._turned += wrap_angle(odometry.theta - self._heading)
        self._heading = odometry.theta
        if self._turn:
            self._remaining = self._turn - self._turned
        else:
            self._remaining = self._distance - (self._start.inverse() @ odometry).x
        self._near_for = self._near_for + elapsed if abs(self._remaining) < self._arrival.arrived else 0.0
        self.arrived = self._near_for > self._arrival.near_time
        stopping = math.sqrt(self._arrival.braking_share * self._acceleration * abs(self._remaining))
        speed = math.copysign(
            min(self._limit, stopping, self._arrival.approach_rate * abs(self._remaining)), self._remaining
        )
        if self._turn:
            return Twist2D(0.0, 0.0, speed)
        steer = max(-self._limits.max_wz, min(self._limits.max_wz, -HEADING_GAIN * self._turned))
        return Twist2D(speed, 0.0, steer)


class BaseCommandChecks:
    """Checks of a base's commands; they raise CommandRefusedError."""

    def __init__(self, part_name: str, model: BaseModel) -> None:
        self._part_name, self._limits = part_name, model.part

    def velocity(self, vx: float, vy: float, wz: float) -> Twist2D:
        """Return the velocity (m/s, rad/s). Raises CommandRefusedError beyond a limit."""
        limits = self._limits
        for what, value, limit, unit in (
            ("vx", vx, limits.max_vx, "m/s"),
            ("vy", vy, limits.max_vy, "m/s"),
            ("wz", wz, limits.max_wz, "rad/s"),
        ):
            if not (math.isfinite(value) and abs(value) <= limit + 1e-9):
                raise refusal(self._part_name, "set_velocity", f"{what} = {value} {unit}, its limit is {limit} {unit}")
        return Twist2D(float(vx), float(vy), float(wz))

    def distance(self, command: str, distance: float) -> float:
        """Return ``distance``, metres. Raises CommandRefusedError unless it is finite and above 0."""
        if not (math.isfinite(distance) and distance > 0.0):
            raise refusal(self._part_name, command, f"distance = {distance} m should be finite and above 0")
        return float(distance)

    def angle(self, command: str, angle: float) -> float:
        """Return ``angle``, radians. Raises CommandRefusedError unless it is finite."""
        if not math.isfinite(angle):
            raise refusal(self._part_name, command, f"angle = {angle} rad should be finite")
        return float(angle)
