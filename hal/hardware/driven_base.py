"""Mobile bases of real robots: velocities within the limits, with a dead-man; distances and turns by odometry."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.robot_model import BaseModel
from hal.api import BaseDescription, MobileBase, Motion, MotionErrorCode, MotionStatus
from hal.hardware.channels import BaseChannel
from hal.hardware.course import Course
from hal.hardware.fault import Fault
from hal.hardware.hardware_part import HardwarePart
from hal.hardware.part_line import PartLine
from hal.hardware.stop_latch import StopLatch
from hal.parts import BaseCommandChecks, PartMotion


@dataclass(frozen=True)
class DrivingParameters:
    """``command_timeout``: seconds after which ``set_velocity`` lapses; a stop brakes within ``stop_time`` seconds.

    ``rest_repeats``: how many times a velocity of zero is sent when the base has come to rest, before it falls silent.
    """

    command_timeout: float = 0.25
    stop_time: float = 0.3
    rest_repeats: int = 20


class DrivenBase(HardwarePart, MobileBase):
    """A base over a channel. A loop of the connection calls ``cycle`` once per control period."""

    def __init__(
        self,
        name: str,
        model: BaseModel,
        channel: BaseChannel,
        latch: StopLatch,
        parameters: DrivingParameters | None = None,
    ) -> None:
        super().__init__(name)
        self._model, self._channel = model, channel
        self._parameters = parameters or DrivingParameters()
        self._checks = BaseCommandChecks(name, model)
        self._line = PartLine(name, latch)
        self._wanted = self._sent = Twist2D(0.0, 0.0, 0.0)
        self._braking = False
        self._lapses_in = 0.0
        self._course: Course | None = None
        self._silent_after = 0

    @property
    def description(self) -> BaseDescription:
        """Limits and footprint."""
        return self._checks.description(self._parameters.command_timeout)

    # Measurements

    def odometry(self) -> Pose2D:
        """As the base tells it."""
        self._line.check_reading()
        return self._channel.read().odometry

    def velocity(self) -> Twist2D:
        """As the base tells it."""
        self._line.check_reading()
        return self._channel.read().velocity

    # Commands

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity, approached within the acceleration limits; lapses after ``command_timeout``."""
        with self._line.lock:
            self._line.check_command("set_velocity")
            velocity = self._checks.velocity(vx, vy, wz)
            self._line.begin(None)
            self._course, self._braking = None, False
            self._wanted = velocity
            self._lapses_in = self._parameters.command_timeout

    def move_forward(self, distance: float) -> Motion:
        """Drive straight ahead by odometry."""
        return self._go("move_forward", distance, 1.0)

    def move_backward(self, distance: float) -> Motion:
        """Drive straight back by odometry."""
        return self._go("move_backward", distance, -1.0)

    def rotate(self, angle: float) -> Motion:
        """Turn on the spot by odometry; more than a full turn is turned in full."""
        with self._line.lock:
            self._line.check_command("rotate")
            angle = self._checks.angle("rotate", angle)
            return self._start(Course(self._model, self._channel.read().odometry, turn=angle))

    def stop(self) -> None:
        """Brake to rest within half a second, ending the motion under way."""
        with self._line.lock:
            if self._line.connected:
                self._halt(hard=True)
                self._line.stop_motion()

    def brake(self) -> None:
        """Brake to rest within the acceleration limits."""
        with self._line.lock:
            self._halt(hard=False)

    # The connection's side

    def attach(self) -> None:
        """Stand, and tell the base so: it may still do what it was told last in an earlier connection."""
        with self._line.lock:
            self._channel.read()
            self._wanted = self._sent = Twist2D(0.0, 0.0, 0.0)
            self._course, self._silent_after = None, self._parameters.rest_repeats
            self._line.open()

    def detach(self) -> None:
        """The controller disconnects: brake."""
        with self._line.lock:
            self._halt(hard=True)
            self._line.close()

    @property
    def resting(self) -> bool:
        """Whether it has been told to stand still."""
        return self._wanted == self._sent == Twist2D(0.0, 0.0, 0.0)

    def fail(self, fault: Fault) -> None:
        """The motion has failed; the base is told to stop, as far as it hears."""
        with self._line.lock:
            self._line.fail_motion(fault)
            self._halt(hard=True)

    def cycle(self, elapsed: float) -> None:
        """One control period, begun ``elapsed`` seconds after the last one: the next velocity, if one is due."""
        with self._line.lock:
            self._decide(elapsed)
            rest = self._wanted == self._sent == Twist2D(0.0, 0.0, 0.0)
            self._silent_after = self._silent_after - 1 if rest else self._parameters.rest_repeats
            if rest and self._silent_after < 0:
                self._silent_after = 0
                return
            self._sent = self._approached(elapsed)
            velocity = self._sent
        self._channel.send(velocity)

    # Private

    def _go(self, command: str, distance: float, direction: float) -> Motion:
        with self._line.lock:
            self._line.check_command(command)
            distance = self._checks.distance(command, distance)
            return self._start(Course(self._model, self._channel.read().odometry, distance=direction * distance))

    def _start(self, course: Course) -> Motion:
        motion = PartMotion(self)
        self._line.begin(motion)
        self._course, self._braking = course, False
        return motion

    def _decide(self, elapsed: float) -> None:
        if self._course is None:
            self._lapses_in -= elapsed
            if self._lapses_in < 0.0:
                self._wanted = Twist2D(0.0, 0.0, 0.0)
            return
        course, motion = self._course, self._line.motion
        self._wanted = course.velocity(self._channel.read().odometry, elapsed)
        if course.arrived:
            self._halt(hard=False)
            if motion is not None:
                motion.succeed()
        elif course.overdue:
            self._halt(hard=False)
            self._line.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, course.remainder())

    def _halt(self, hard: bool) -> None:
        self._course, self._braking = None, hard
        self._wanted, self._lapses_in = Twist2D(0.0, 0.0, 0.0), 0.0

    def _approached(self, elapsed: float) -> Twist2D:
        """The velocity next to the last one on the way to the wanted one, within the acceleration limits."""
        model, sent, wanted = self._model, self._sent, self._wanted
        linear, angular = model.max_acceleration, model.max_angular_acceleration
        if self._braking:
            linear = max(linear, model.max_vx / self._parameters.stop_time)
            angular = max(angular, model.max_wz / self._parameters.stop_time)

        def towards(value: float, goal: float, step: float) -> float:
            return value + min(max(goal - value, -step), step)

        return Twist2D(
            towards(sent.vx, wanted.vx, linear * elapsed),
            towards(sent.vy, wanted.vy, linear * elapsed),
            towards(sent.wz, wanted.wz, angular * elapsed),
        )
