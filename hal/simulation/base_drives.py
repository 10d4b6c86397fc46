"""Bases on driven wheels as a channel: motors, parking, steering, odometry from encoders.

Legs: joint torques at the physics rate, odometry from legs and inertial unit.
"""

from __future__ import annotations

import contextlib
import math
from abc import ABC, abstractmethod
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from bestman_bt.messages import GRAVITY, Pose2D, Twist2D, wrap_angle
from bestman_bt.robot_model.model import LeggedBaseModel, WheeledBaseModel
from bestman_bt.robot_model.part_config import BasePart
from bestman_bt.robot_model.payload import Payload
from hal.api import Imu, NoDataError, NotConnectedError
from hal.parts.channels import BaseChannel, BaseReading
from hal.parts.legged.walker import TrotGait
from hal.simulation.parameters import SimulationParameters
from hal.simulation.sensor_pipeline import EncoderReading, Encoders
from hal.simulation.simulation import SimulatedChannel, Simulation

# Kinematics of driven wheels, and odometry from their encoders; pure.
# Siegwart, Nourbakhsh and Scaramuzza, "Introduction to Autonomous Mobile Robots", 2011, chapter 3; skid steering by an
# effective track: Mandow et al., "Experimental kinematics for wheeled skid-steer mobile robots", IROS 2007.


Array = NDArray[np.float64]
Velocity = tuple[float, float, float]
"""vx, vy, wz in the base frame, m/s and rad/s; or a displacement, metres and radians."""


class Drive(ABC):
    """The kinematics between the velocity of a base and its n wheels and k steering joints; radians."""

    @abstractmethod
    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """Return the wheel speeds (n,), rad/s, for a velocity, at the ``steering`` angles (k,), radians."""

    @abstractmethod
    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """Return the velocity (m/s, rad/s) for wheel speeds (n,), rad/s, or the displacement for wheel angles (n,),
        rad.
        """

    def steering_angles(self, velocity: Velocity, present: Array) -> Array:
        """Return the target angles of the steering joints (k,), the nearer of two solutions; empty without steering
        joints.
        """
        return present


@dataclass(frozen=True)
class SideDrive(Drive):
    """A differential or skid-steered drive; wheels in the order left, right, left, right. Lengths in metres.

    The radii may differ (calibration errors). ``track``: effective distance between left and right wheels; skid
    steering makes it larger than the distance of the wheels.
    """

    left_radius: float
    right_radius: float
    track: float
    wheels: int = 2

    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """Return equal speeds on each side; the sideways velocity cannot be driven."""
        vx, _, wz = velocity
        half = wz * self.track / 2.0
        return np.array([(vx - half) / self.left_radius, (vx + half) / self.right_radius] * (self.wheels // 2))

    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """Return the motion from the mean of each side."""
        left_path = float(wheels[0::2].mean()) * self.left_radius
        right_path = float(wheels[1::2].mean()) * self.right_radius
        return (left_path + right_path) / 2.0, 0.0, (right_path - left_path) / self.track


@dataclass(frozen=True, eq=False)
class SteeredDrive(Drive):
    """Wheels that each turn about a vertical axis above them: ``places`` (n, 2) metres in the base, ``radii`` (n,).

    At a steering angle of zero a wheel rolls along x. Steering joints are continuous.
    """

    places: Array
    radii: Array

    def steering_angles(self, velocity: Velocity, present: Array) -> Array:
        """Return angles at most 90° from the present ones, as wheels can roll backwards; at rest the present ones."""
        ways = self._wheel_velocities(velocity)
        wanted = np.arctan2(ways[:, 1], ways[:, 0])
        turn = (wanted - present + np.pi / 2) % np.pi - np.pi / 2
        return np.where(np.hypot(*ways.T) > 1e-4, present + turn, present)

    def wheel_speeds(self, velocity: Velocity, steering: Array) -> Array:
        """Return the speeds of the wheels (n,), rad/s, from each wheel's velocity along its rolling direction."""
        along = np.column_stack([np.cos(steering), np.sin(steering)])
        speeds: Array = np.sum(self._wheel_velocities(velocity) * along, axis=1) / self.radii
        return speeds

    def motion(self, wheels: Array, steering: Array) -> Velocity:
        """Return the rigid motion whose wheel velocities fit the measured ones best, by least squares."""
        rolled = (wheels * self.radii)[:, None] * np.column_stack([np.cos(steering), np.sin(steering)])
        n = len(self.radii)
        rows = np.zeros((2 * n, 3))
        rows[0::2, 0] = rows[1::2, 1] = 1.0
        rows[0::2, 2], rows[1::2, 2] = -self.places[:, 1], self.places[:, 0]
        vx, vy, wz = np.linalg.lstsq(rows, rolled.ravel(), rcond=None)[0]
        return float(vx), float(vy), float(wz)

    def _wheel_velocities(self, velocity: Velocity) -> Array:
        vx, vy, wz = velocity
        return np.column_stack([vx - wz * self.places[:, 1], vy + wz * self.places[:, 0]])


class Odometry:
    """Dead reckoning from wheel angles (rad), midpoint rule: the pose since the first reading, and the path."""

    def __init__(self, drive: Drive, wheels: Array) -> None:
        self._drive = drive
        self._wheels = np.array(wheels)
        self.x = self.y = self.heading = self.travelled = 0.0

    @property
    def pose(self) -> Pose2D:
        """The pose in the odom frame."""
        return Pose2D(self.x, self.y, wrap_angle(self.heading))

    def update(self, wheels: Array, steering: Array) -> None:
        """Integrate a reading of the wheels (n,) and the steering joints (k,)."""
        forward, left, angle = self._drive.motion(wheels - self._wheels, steering)
        self._wheels = np.array(wheels)
        middle = self.heading + angle / 2.0
        self.x += forward * math.cos(middle) - left * math.sin(middle)
        self.y += forward * math.sin(middle) + left * math.cos(middle)
        self.heading += angle
        self.travelled += forward


def make_drives(model: WheeledBaseModel, calibration: float, rng: np.random.Generator) -> tuple[Drive, Drive]:
    """Return the true drive of a base, and the drive assumed by its odometry.

    ``calibration``: standard deviation of the relative errors of the assumed wheel radii and track.
    """
    base = model.part
    if base.drive == "steered":
        places, radii = np.array(model.wheel_places), np.full(len(base.wheel_joints), base.wheel_radius)
        errors = 1.0 + calibration * rng.normal(size=len(radii))
        return SteeredDrive(places, radii), SteeredDrive(places, radii * errors)
    left, right, track = (1.0 + calibration * float(error) for error in rng.normal(size=3))
    radius, width, wheels = base.wheel_radius, base.track * base.turning_slip, len(base.wheel_joints)
    return (
        SideDrive(radius, radius, width, wheels),
        SideDrive(radius * left, radius * right, width * track, wheels),
    )


SPEED_WINDOW = 1.0 / 60.0
"""Seconds between the two encoder counts from which a speed is computed; at least a control period."""
PARK_AFTER = 0.1
# Steered wheels that point further than this from where they should stand still until they have turned, radians.
ASTRAY = math.radians(20.0)
STILL = Twist2D(0.0, 0.0, 0.0)


class WheelDrive(SimulatedChannel, BaseChannel):
    """Drives the wheels at given speeds; after a stop, once at rest, they are held in position."""

    def __init__(
        self, name: str, model: WheeledBaseModel, parameters: SimulationParameters, rng: np.random.Generator
    ) -> None:
        self._model, self._parameters = model, parameters
        self._drive, self._believed = make_drives(model, parameters.odometry_calibration, rng)
        self.encoders = Encoders(name, model.part.encoders, parameters.step_rate, rng)
        self._wheels = len(model.part.wheel_joints)
        self._odometry = Odometry(self._believed, np.zeros(self._wheels))
        self._attached_motors: WheelMotors | None = None
        self._sent = STILL
        self._still_for, self._parked = 0.0, False

    def attach(self, simulation: Simulation) -> None:
        """Stop the wheels and reset the odometry to zero."""
        super().attach(simulation)
        motors = self._attached_motors = WheelMotors(simulation, self._model.part, self._parameters)
        self.encoders.attach(
            simulation, lambda: EncoderReading(np.concatenate([motors.angles, motors.steering]), motors.speeds)
        )
        self._odometry = Odometry(self._believed, motors.angles)
        self._sent, self._still_for, self._parked = STILL, 0.0, True
        motors.park()
        simulation.controls.append(self.watch)

    @override
    def detach(self) -> None:
        super().detach()
        self._attached_motors = None
        self.encoders.detach()

    def read(self) -> BaseReading:
        """Return dead reckoning since connecting, with the calibration errors of this robot."""
        reading = self.encoders.read()
        self._odometry.update(reading.positions[: self._wheels], reading.positions[self._wheels :])
        return BaseReading(
            self._odometry.pose, Twist2D(*self._believed.motion(reading.speeds, reading.positions[self._wheels :]))
        )

    def send(self, velocity: Twist2D) -> bool:
        """Drive at ``velocity``; steered wheels first turn to the required angles, and the velocity is ignored
        meanwhile."""
        motors = self._motors
        self._sent = velocity
        if velocity == STILL and self._parked:
            return True
        if velocity != STILL:
            self._parked, self._still_for = False, 0.0
        triple = velocity.vx, velocity.vy, velocity.wz
        if motors.steer(self._drive.steering_angles(triple, motors.steering)) > ASTRAY:
            motors.drive(np.zeros(self._wheels))
            return False
        motors.drive(self._drive.wheel_speeds(triple, motors.steering))
        return True

    @property
    def _motors(self) -> WheelMotors:
        if self._attached_motors is None:
            raise NotConnectedError("the robot is not connected; call connect()")
        return self._attached_motors

    def watch(self) -> None:
        """Read the wheel encoders, and hold the wheels once they have been at rest for a while."""
        motors = self._motors
        motors.count()
        with contextlib.suppress(NoDataError):
            self.read()
        if self._parked or self._sent != STILL:
            return
        still = float(np.abs(motors.speeds).max()) * self._model.part.wheel_radius < 0.01
        self._still_for = self._still_for + self._parameters.control_period if still else 0.0
        if self._still_for >= PARK_AFTER:
            motors.park()
            self._parked = True


class WheelMotors:
    """Wheels (n,) turn at a speed or are held; steering joints (k,) follow angles at their own limited speed."""

    def __init__(self, simulation: Simulation, base: BasePart, parameters: SimulationParameters) -> None:
        self._simulation, self._base, self._parameters = simulation, base, parameters
        self._engine = simulation.actor()
        self._wheels = simulation.slots(base.wheel_joints)
        self._steering = simulation.slots(base.steering_joints)
        self._wheel_indices = simulation.joints(base.wheel_joints)
        self._steering_indices = simulation.joints(base.steering_joints)
        self._steered_to = self.steering
        periods = max(1, round(SPEED_WINDOW / parameters.control_period))
        self._counts = deque([self.angles.copy()], maxlen=periods + 1)

    def count(self) -> None:
        """Read the encoders' counts, once per control period.

        A motor that holds its wheel against friction oscillates by hundredths of a millimetre in every physics step, so
        a speed over one step is meaningless.
        """
        self._counts.append(self.angles.copy())

    @property
    def angles(self) -> Array:
        """Measured angles of the wheels, (n,) rad."""
        values: Array = self._simulation.joint_states()[0, self._wheels]
        return values

    @property
    def speeds(self) -> Array:
        """Measured speeds of the wheels over ``SPEED_WINDOW``, (n,) rad/s."""
        elapsed = max(1, len(self._counts) - 1) * self._parameters.control_period
        return np.asarray((self._counts[-1] - self._counts[0]) / elapsed)

    @property
    def steering(self) -> Array:
        """Measured angles of the steering joints, (k,) rad."""
        values: Array = self._simulation.joint_states()[0, self._steering]
        return values

    def steer(self, angles: Array) -> float:
        """Turn the steering joints towards ``angles`` (k,), radians. Returns the largest remaining deviation,
        radians."""
        if not len(angles):
            return 0.0
        step = self._base.steering_speed * self._parameters.control_period
        self._steered_to = self._steered_to + np.clip(angles - self._steered_to, -step, step)
        self._hold(self._steering_indices, self._steered_to, self._base.steering_torque, self._parameters.steering_gain)
        return float(np.abs(angles - self.steering).max())

    def drive(self, speeds: Array) -> None:
        """Turn the wheels at ``speeds`` (n,), rad/s."""
        engine, torques = self._engine, [self._base.wheel_torque] * len(self._wheel_indices)
        engine.turn(engine.built.robot, self._wheel_indices, speeds.tolist(), torques)

    def park(self) -> None:
        """Hold wheels and steering in position, because a velocity motor at zero yields to the forces of the arm."""
        self._hold(self._wheel_indices, self.angles, self._base.wheel_torque, self._parameters.wheel_hold_gain)
        self._steered_to = self.steering
        self.steer(self._steered_to)

    def _hold(self, indices: list[int], angles: Array, torque: float, gain: float) -> None:
        self._engine.track(indices, angles, np.zeros(len(indices)), [torque] * len(indices), gain)


LEGS_CANNOT = {
    "velocities of a base lapse": "legs report the mean over a step of 0.3 s, longer than the dead-man timeout",
    "a base moves in its own frame": "legs sway: by up to 3 cm aside in the second after their first two steps",
    "a base drives and turns by odometry": "legs stop where feet land, within 2 cm, and wander by up to 4 cm in a turn",
    "a motion of a base can be cancelled": "legs sway for up to 0.7 s after cancel(), by up to 0.03 m/s or rad/s",
}
"""Features of the Robotics API, and conformance checks, that this walker does not support → reason."""


class LegDrive(SimulatedChannel, BaseChannel):
    """A walking base that trots. It uses only its joints and its IMU. ``body``: mass and centre of mass of the whole
    robot.
    """

    def __init__(self, model: LeggedBaseModel, parameters: SimulationParameters, imu: Imu, body: Payload) -> None:
        self._model, self._parameters, self._imu, self._body = model, parameters, imu, body
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._indices: list[int] = []
        self._velocity = np.zeros(3)
        self._walker = TrotGait(model, body)

    def attach(self, simulation: Simulation) -> None:
        """Stand up and reset the odometry to zero."""
        super().attach(simulation)
        self._slots = simulation.slots(self._model.part.joints)
        self._indices = simulation.joints(self._model.part.joints)
        self._walker, self._velocity = TrotGait(self._model, self._body), np.zeros(3)
        simulation.release(self._indices)
        simulation.effort_controls.append(self._exert)

    def read(self) -> BaseReading:
        """Return odometry: distances from the feet on the floor, headings from the gyroscope; mean velocity over one
        step of all legs.
        """
        vx, vy, wz = self._walker.velocity
        return BaseReading(self._walker.odometry.pose, Twist2D(float(vx), float(vy), float(wz)))

    def send(self, velocity: Twist2D) -> bool:
        """Trot at a velocity."""
        self._velocity = np.array([velocity.vx, velocity.vy, velocity.wz])
        return True

    def _exert(self) -> None:
        simulation = self.simulation
        angles, speeds, _ = simulation.joint_states()[:, self._slots]
        try:
            reading = self._imu.read()
            turning, force = reading.angular_velocity, reading.linear_acceleration
        except NoDataError:  # before its first reading, and where it is switched off
            turning, force = np.zeros(3), np.array([0.0, 0.0, GRAVITY])
        shape = (len(self._model.legs), 3)
        step = self._parameters.time_step
        torques = self._walker.update(
            self._velocity, angles.reshape(shape), speeds.reshape(shape), turning, force, step
        ).ravel()
        simulation.torques[self._slots] = torques
        self.motors.exert(self._indices, torques)
