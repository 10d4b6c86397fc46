"""What simulated bases share: velocities within acceleration limits, dead-man, motions by odometry."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable

from bestman_bt.robot_model import BaseModel
from hal.api import BaseDescription, MobileBase, Motion, MotionErrorCode, MotionStatus, NoDataError
from hal.parts import BaseCommandChecks, PartMotion
from hal.pybullet.drive import Velocity
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.part import Connection
from hal.pybullet.simulation import Simulation

HEADING_GAIN = 2.0
STILL: Velocity = (0.0, 0.0, 0.0)


class SimulatedMobileBase(MobileBase):
    """A base that makes its way somehow: subclasses bring odometry and turn ``_commanded`` into motion.

    ``_wanted`` is what set_velocity or a motion asks for, ``_commanded`` the same within the acceleration limits.
    """

    def __init__(
        self,
        name: str,
        model: BaseModel,
        parameters: PhysicsParameters,
        stopped: Callable[[], bool],
        arrived: float,
        stop_time: float,
    ) -> None:
        super().__init__(name)
        self._model, self._parameters, self._arrived, self._stop_time = model, parameters, arrived, stop_time
        self._checks = BaseCommandChecks(name, model)
        self._connection = Connection(name, stopped)
        self._wanted = STILL
        self._commanded = STILL
        self._lapses_in = 0.0
        self._course: _Course | None = None
        self._braking = (0.0, 0.0)  # m/s² and rad/s², where more than the limits

    @property
    def description(self) -> BaseDescription:
        """Limits and footprint."""
        return self._checks.description(self._parameters.command_timeout)

    # What subclasses bring

    @abstractmethod
    def _update_odometry(self) -> None:
        """Take in what encoders say; raises NotConnectedError, NoDataError."""

    @property
    @abstractmethod
    def _heading(self) -> float:
        """Of the odometry, radians without end."""

    @property
    @abstractmethod
    def _travelled(self) -> float:
        """Path of the odometry along x of the base, metres."""

    @abstractmethod
    def _move(self, period: float) -> None:
        """Make ``_commanded`` follow ``_wanted``, and the base follow it."""

    @abstractmethod
    def _rest(self, period: float) -> None:
        """Nothing is wanted and nothing commanded."""

    # Commands

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity, approached within the acceleration limits; lapses after ``command_timeout``."""
        self._connection.check_command("set_velocity")
        velocity = self._checks.velocity(vx, vy, wz)
        self._connection.begin(None)
        self._course, self._braking = None, (0.0, 0.0)
        self._wanted = (velocity.vx, velocity.vy, velocity.wz)
        self._lapses_in = self._parameters.command_timeout

    def move_forward(self, distance: float) -> Motion:
        """Drive straight ahead by odometry."""
        return self._go("move_forward", distance, 1.0)

    def move_backward(self, distance: float) -> Motion:
        """Drive straight back by odometry."""
        return self._go("move_backward", distance, -1.0)

    def rotate(self, angle: float) -> Motion:
        """Turn on the spot by odometry; more than a full turn is turned in full."""
        self._connection.check_command("rotate")
        angle = self._checks.angle("rotate", angle)
        self._update_odometry()
        model = self._model
        time = abs(angle) / model.max_wz + model.max_wz / model.max_angular_acceleration
        return self._start(_Course(0.0, self._heading + angle, turning=True, time_left=2.0 * time + 3.0))

    def stop(self) -> None:
        """Brake to rest within half a second."""
        if not self._connection.present:
            return
        vx, vy, wz = self._commanded
        self._halt((math.hypot(vx, vy) / self._stop_time, abs(wz) / self._stop_time))
        self._connection.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")

    def brake(self) -> None:
        """Brake to rest within the acceleration limits."""
        self._halt((0.0, 0.0))

    # The simulation's side

    def _begin(self, simulation: Simulation) -> None:
        """Stand, and be asked for in every control period."""
        self._wanted = self._commanded = STILL
        self._course = None
        simulation.controls.append(self._control)

    def detach(self) -> None:
        """Let go."""
        self._connection.detach()

    def _control(self) -> None:
        period = self._parameters.control_period
        try:
            self._update_odometry()
        except NoDataError as error:
            if self._course is not None:
                self._halt((0.0, 0.0))
                self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.FAULT, str(error))
        if self._course is not None:
            self._steer(self._course, period)
        elif self._wanted != STILL:
            self._lapses_in -= period
            if self._lapses_in < -1e-9:
                self._wanted = STILL
        if self._wanted == STILL and self._commanded == STILL:
            self._rest(period)
            return
        self._move(period)

    def _accelerated(self, period: float) -> Velocity:
        """The commanded velocity, one period nearer to the wanted one within the limits of acceleration."""
        step = max(self._model.max_acceleration, self._braking[0]) * period
        turn = max(self._model.max_angular_acceleration, self._braking[1]) * period
        dx, dy, dw = (wanted - now for wanted, now in zip(self._wanted, self._commanded, strict=True))
        if self._model.steering_joints:  # in one stride, so that the wheels keep pointing one way
            share = min(1.0, step / max(math.hypot(dx, dy), 1e-9), turn / max(abs(dw), 1e-9))
            if share == 1.0:
                return self._wanted
            dx, dy, dw = share * dx, share * dy, share * dw
        vx, vy, wz = self._commanded
        return (
            vx + min(max(dx, -step), step),
            vy + min(max(dy, -step), step),
            wz + min(max(dw, -turn), turn),
        )

    # Motions

    def _go(self, command: str, distance: float, direction: float) -> Motion:
        self._connection.check_command(command)
        distance = self._checks.distance(command, distance)
        self._update_odometry()
        model = self._model
        time = distance / model.max_vx + model.max_vx / model.max_acceleration
        target = self._travelled + direction * distance
        return self._start(_Course(target, self._heading, turning=False, time_left=2.0 * time + 3.0))

    def _start(self, course: _Course) -> Motion:
        motion = PartMotion(self)
        self._connection.begin(motion)
        self._course = course
        self._braking = (0.0, 0.0)
        return motion

    def _steer(self, course: _Course, period: float) -> None:
        model = self._model
        motion = self._connection.motion
        turn = course.heading - self._heading
        course.time_left -= period
        if course.turning:
            remaining, speed = turn, self._commanded[2]
            limit, acceleration = model.max_wz, model.max_angular_acceleration
        else:
            remaining, speed = course.distance - self._travelled, self._commanded[0]
            limit, acceleration = model.max_vx, model.max_acceleration
        if abs(remaining) < self._arrived and abs(speed) < acceleration * period * 2:
            self._halt((0.0, 0.0))
            if motion is not None:
                motion.succeed()
            return
        if course.time_left < 0.0:
            self._halt((0.0, 0.0))
            text = f"{remaining:.3f} {'rad' if course.turning else 'm'} are left when they should be done"
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, text)
            return
        # The speed from which it can still stop; a share of the limit leaves room for the base's lag.
        wanted = math.copysign(
            min(limit, math.sqrt(1.6 * acceleration * abs(remaining)), 6.0 * abs(remaining)), remaining
        )
        if course.turning:
            self._wanted = (0.0, 0.0, wanted)
        else:
            self._wanted = (wanted, 0.0, max(-model.max_wz, min(model.max_wz, HEADING_GAIN * turn)))

    def _halt(self, braking: tuple[float, float]) -> None:
        self._course = None
        self._wanted = STILL
        self._braking = braking


class _Course:
    """What a motion drives at: a distance travelled and a heading of the odometry."""

    def __init__(self, distance: float, heading: float, turning: bool, time_left: float) -> None:
        self.distance, self.heading, self.turning, self.time_left = distance, heading, turning, time_left
