"""Simulated bases on wheels: motors within acceleration limits, dead-man, odometry from encoders."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.robot_model import BaseModel
from hal.api import BaseDescription, MobileBase, Motion, MotionErrorCode, MotionStatus, NotConnectedError
from hal.parts import BaseCommandChecks, PartMotion
from hal.pybullet.drive import Odometry, Velocity, make_drives
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.part import Connection
from hal.pybullet.simulation import Simulation
from hal.pybullet.wheel_motors import WheelMotors

PARK_AFTER = 0.1
ARRIVED = 0.001
HEADING_GAIN = 2.0
STILL: Velocity = (0.0, 0.0, 0.0)
# Steered wheels that point further than this from where they should stand still until they have turned, radians.
ASTRAY = math.radians(20.0)


class SimulatedBase(MobileBase):
    """A base on driven wheels. Standing, they are held in position."""

    def __init__(
        self,
        name: str,
        model: BaseModel,
        parameters: PhysicsParameters,
        stopped: Callable[[], bool],
        rng: np.random.Generator,
    ) -> None:
        super().__init__(name)
        self._model, self._parameters = model, parameters
        self._checks = BaseCommandChecks(name, model)
        self._connection = Connection(name, stopped)
        self._drive, self._believed = make_drives(model, parameters.odometry_calibration, rng)
        self._odometry = Odometry(self._believed, np.zeros(len(model.wheel_joints)))
        self._attached: WheelMotors | None = None
        self._wanted = STILL  # what set_velocity or a motion asks for
        self._commanded = STILL  # the same after the acceleration limits: what the wheels get
        self._lapses_in = 0.0
        self._course: _Course | None = None
        self._braking = (0.0, 0.0)  # m/s² and rad/s², where more than the limits
        self._still_for = 0.0
        self._parked = False

    @property
    def description(self) -> BaseDescription:
        """Limits and footprint."""
        return self._checks.description(self._parameters.command_timeout)

    # Measurements

    def odometry(self) -> Pose2D:
        """Dead reckoning since connecting, with the calibration errors of this robot."""
        self._update_odometry()
        return self._odometry.pose

    def velocity(self) -> Twist2D:
        """Velocity from the wheels' speeds."""
        return Twist2D(*self._believed.motion(self._motors.speeds, self._motors.steering))

    # Commands

    def set_velocity(self, vx: float, vy: float, wz: float) -> None:
        """Drive at a velocity, approached within the acceleration limits; lapses after ``command_timeout``."""
        self._connection.check_command("set_velocity")
        velocity = self._checks.velocity(vx, vy, wz)
        self._connection.begin(None)
        self._course = None
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
        return self._start(_Course(0.0, self._odometry.heading + angle, turning=True, time_left=2.0 * time + 3.0))

    def stop(self) -> None:
        """Brake to rest within half a second."""
        if not self._connection.present:
            return
        vx, vy, wz = self._commanded
        self._halt((math.hypot(vx, vy) / self._parameters.stop_time, abs(wz) / self._parameters.stop_time))
        self._connection.end_motion(MotionStatus.CANCELED, MotionErrorCode.STOPPED, "stopped")

    def brake(self) -> None:
        """Brake to rest within the acceleration limits."""
        self._halt((0.0, 0.0))

    # The simulation's side

    def attach(self, simulation: Simulation) -> None:
        """Stand, with odometry at zero."""
        self._connection.attach(simulation)
        self._attached = WheelMotors(simulation, self._model, self._parameters)
        self._odometry = Odometry(self._believed, self._motors.angles)
        self._wanted = self._commanded = STILL
        self._course, self._parked = None, False
        self._park()
        simulation.controls.append(self._control)

    def detach(self) -> None:
        """Let go."""
        self._connection.detach()

    def _control(self) -> None:
        self._update_odometry()
        period = self._parameters.control_period
        if self._course is not None:
            self._steer(self._course, period)
        elif self._wanted != STILL:
            self._lapses_in -= period
            if self._lapses_in < -1e-9:
                self._wanted = STILL
        if self._wanted == STILL and self._commanded == STILL:
            if not self._parked:
                self._wait_for_rest(period)
            return
        self._drive_wheels(period)

    def _drive_wheels(self, period: float) -> None:
        """Steered wheels first turn to where the velocity asks them to; meanwhile it stays what it was."""
        self._parked, self._still_for = False, 0.0
        velocity = self._accelerated(period)
        angles = self._drive.steering_angles(velocity, self._motors.steering)
        if self._motors.steer(angles) > ASTRAY:
            self._motors.drive(np.zeros(len(self._model.wheel_joints)))
            return
        self._commanded = velocity
        self._motors.drive(self._drive.wheel_speeds(velocity, self._motors.steering))

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

    def _wait_for_rest(self, period: float) -> None:
        still = float(np.abs(self._motors.speeds).max()) * self._model.wheel_radius < 0.01
        self._still_for = self._still_for + period if still else 0.0
        if self._still_for >= PARK_AFTER:
            self._park()

    def _park(self) -> None:
        self._motors.park()
        self._parked = True

    # Motions

    def _go(self, command: str, distance: float, direction: float) -> Motion:
        self._connection.check_command(command)
        distance = self._checks.distance(command, distance)
        self._update_odometry()
        model = self._model
        time = distance / model.max_vx + model.max_vx / model.max_acceleration
        target = self._odometry.travelled + direction * distance
        return self._start(_Course(target, self._odometry.heading, turning=False, time_left=2.0 * time + 3.0))

    def _start(self, course: _Course) -> Motion:
        motion = PartMotion(self)
        self._connection.begin(motion)
        self._course = course
        self._braking = (0.0, 0.0)
        return motion

    def _steer(self, course: _Course, period: float) -> None:
        model, odometry = self._model, self._odometry
        motion = self._connection.motion
        turn = course.heading - odometry.heading
        course.time_left -= period
        if course.turning:
            remaining, speed = turn, self._commanded[2]
            limit, acceleration = model.max_wz, model.max_angular_acceleration
        else:
            remaining, speed = course.distance - odometry.travelled, self._commanded[0]
            limit, acceleration = model.max_vx, model.max_acceleration
        if abs(remaining) < ARRIVED and abs(speed) < acceleration * period * 2:
            self._halt((0.0, 0.0))
            if motion is not None:
                motion.succeed()
            return
        if course.time_left < 0.0:
            self._halt((0.0, 0.0))
            text = f"{remaining:.3f} {'rad' if course.turning else 'm'} are left when they should be done"
            self._connection.end_motion(MotionStatus.FAILED, MotionErrorCode.TIMEOUT, text)
            return
        # The speed from which it can still stop; a share of the limit leaves room for the wheels' lag.
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

    @property
    def _motors(self) -> WheelMotors:
        if self._attached is None or not self._connection.present:
            raise NotConnectedError(f"{self.name} was used while the robot is not connected; call connect()")
        return self._attached

    def _update_odometry(self) -> None:
        self._odometry.update(self._motors.angles, self._motors.steering)


class _Course:
    """What a motion drives at: a distance travelled and a heading of the odometry."""

    def __init__(self, distance: float, heading: float, turning: bool, time_left: float) -> None:
        self.distance, self.heading, self.turning, self.time_left = distance, heading, turning, time_left
