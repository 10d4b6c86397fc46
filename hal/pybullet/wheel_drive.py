"""Bases on driven wheels as a channel: motors, parking, steering, odometry from encoders."""

from __future__ import annotations

import contextlib
import math

import numpy as np

from bestman_bt.messages import Twist2D
from bestman_bt.robot_model import WheeledBaseModel
from hal.api import NoDataError, NotConnectedError
from hal.parts import BaseChannel, BaseReading
from hal.pybullet.drive import Odometry, make_drives
from hal.pybullet.encoders import EncoderReading, Encoders
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.simulated_channel import SimulatedChannel
from hal.pybullet.simulation import Simulation
from hal.pybullet.wheel_motors import WheelMotors

PARK_AFTER = 0.1
# Steered wheels that point further than this from where they should stand still until they have turned, radians.
ASTRAY = math.radians(20.0)
STILL = Twist2D(0.0, 0.0, 0.0)


class WheelDrive(SimulatedChannel, BaseChannel):
    """Wheels turn at a speed; sent to stand, and once still, they are held in position."""

    def __init__(
        self, name: str, model: WheeledBaseModel, parameters: PhysicsParameters, rng: np.random.Generator
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
