"""Bases on driven wheels as a channel: motors, parking, steering, odometry from encoders."""

from __future__ import annotations

import contextlib
import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model import BasePart, WheeledBaseModel
from hal.api import NoDataError, NotConnectedError
from hal.parts import BaseChannel, BaseReading
from hal.simulation.drive import Odometry, make_drives
from hal.simulation.parameters import SimulationParameters
from hal.simulation.sensor_pipeline import EncoderReading, Encoders
from hal.simulation.simulation import SimulatedChannel, Simulation

Array = NDArray[np.float64]
SPEED_WINDOW = 1.0 / 60.0
"""Seconds between the two counts that a speed is told from, or a control period where that is longer."""
PARK_AFTER = 0.1
# Steered wheels that point further than this from where they should stand still until they have turned, radians.
ASTRAY = math.radians(20.0)
STILL = Twist2D(0.0, 0.0, 0.0)


class WheelDrive(SimulatedChannel, BaseChannel):
    """Wheels turn at a speed; sent to stand, and once still, they are held in position."""

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
        """Stand, with odometry at zero."""
        super().attach(simulation)
        motors = self._attached_motors = WheelMotors(simulation, self._model.part, self._parameters)
        self.encoders.attach(
            simulation, lambda: EncoderReading(np.concatenate([motors.angles, motors.steering]), motors.speeds)
        )
        self._odometry = Odometry(self._believed, motors.angles)
        self._sent, self._still_for, self._parked = STILL, 0.0, True
        motors.park()
        simulation.controls.append(self._watch)

    def detach(self) -> None:
        """Let go."""
        super().detach()
        self._attached_motors = None
        self.encoders.detach()

    def read(self) -> BaseReading:
        """Dead reckoning since connecting, with the calibration errors of this robot."""
        reading = self.encoders.read()
        self._odometry.update(reading.positions[: self._wheels], reading.positions[self._wheels :])
        return BaseReading(
            self._odometry.pose, Twist2D(*self._believed.motion(reading.speeds, reading.positions[self._wheels :]))
        )

    def send(self, velocity: Twist2D) -> bool:
        """Drive; steered wheels first turn to where the velocity asks them to, and it is not taken meanwhile."""
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

    def _watch(self) -> None:
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
        self._wheels = simulation.slots(base.wheel_joints)
        self._steering = simulation.slots(base.steering_joints)
        self._wheel_indices = simulation.joints(base.wheel_joints)
        self._steering_indices = simulation.joints(base.steering_joints)
        self._steered_to = self.steering
        periods = max(1, round(SPEED_WINDOW / parameters.control_period))
        self._counts = deque([self.angles.copy()], maxlen=periods + 1)

    def count(self) -> None:
        """Take the encoders' counts, once in a control period.

        A motor that holds its wheel against friction chatters by hundredths of a millimetre in every physics step:
        its speed over one step is no speed of the base.
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
        """Turn the steering joints towards ``angles`` (k,); how far the farthest of them is away, radians."""
        if not len(angles):
            return 0.0
        step = self._base.steering_speed * self._parameters.control_period
        self._steered_to = self._steered_to + np.clip(angles - self._steered_to, -step, step)
        self._hold(self._steering_indices, self._steered_to, self._base.steering_torque, self._parameters.steering_gain)
        return float(np.abs(angles - self.steering).max())

    def drive(self, speeds: Array) -> None:
        """Turn the wheels at ``speeds`` (n,), rad/s."""
        engine, torques = self._simulation.engine, [self._base.wheel_torque] * len(self._wheel_indices)
        engine.turn(engine.built.robot, self._wheel_indices, speeds.tolist(), torques)

    def park(self) -> None:
        """Hold wheels and steering where they are: a velocity motor at zero gives way under the arm."""
        self._hold(self._wheel_indices, self.angles, self._base.wheel_torque, self._parameters.wheel_hold_gain)
        self._steered_to = self.steering
        self.steer(self._steered_to)

    def _hold(self, indices: list[int], angles: Array, torque: float, gain: float) -> None:
        self._simulation.engine.track(indices, angles, np.zeros(len(indices)), [torque] * len(indices), gain)
