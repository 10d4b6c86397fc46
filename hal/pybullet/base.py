"""Simulated bases on wheels: motors, odometry from encoders."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from bestman_bt.messages import Pose2D, Twist2D
from bestman_bt.robot_model import BaseModel
from hal.api import NotConnectedError
from hal.pybullet.drive import Odometry, make_drives
from hal.pybullet.encoders import EncoderReading, Encoders
from hal.pybullet.mobile_base import SimulatedMobileBase
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.simulation import Simulation
from hal.pybullet.wheel_motors import WheelMotors

PARK_AFTER = 0.1
ARRIVED = 0.001
# Steered wheels that point further than this from where they should stand still until they have turned, radians.
ASTRAY = math.radians(20.0)


class SimulatedBase(SimulatedMobileBase):
    """A base on driven wheels. Standing, they are held in position."""

    def __init__(
        self,
        name: str,
        model: BaseModel,
        parameters: PhysicsParameters,
        stopped: Callable[[], bool],
        rng: np.random.Generator,
    ) -> None:
        super().__init__(name, model, parameters, stopped, ARRIVED, parameters.stop_time)
        self._drive, self._believed = make_drives(model, parameters.odometry_calibration, rng)
        self.encoders = Encoders(name, model.encoders, parameters.step_rate, rng)
        self._odometry = Odometry(self._believed, np.zeros(len(model.wheel_joints)))
        self._attached: WheelMotors | None = None
        self._still_for = 0.0
        self._parked = False

    # Measurements

    def odometry(self) -> Pose2D:
        """Dead reckoning since connecting, with the calibration errors of this robot; NoDataError as ``velocity``."""
        self._update_odometry()
        return self._odometry.pose

    def velocity(self) -> Twist2D:
        """Velocity from the wheels' speeds over the last sixtieth of a second; NoDataError where encoders tell none."""
        reading = self.encoders.read()
        return Twist2D(*self._believed.motion(reading.speeds, reading.positions[self._wheels :]))

    # The simulation's side

    def attach(self, simulation: Simulation) -> None:
        """Stand, with odometry at zero."""
        self._connection.attach(simulation)
        motors = self._attached = WheelMotors(simulation, self._model, self._parameters)
        self.encoders.attach(
            simulation, lambda: EncoderReading(np.concatenate([motors.angles, motors.steering]), motors.speeds)
        )
        self._odometry = Odometry(self._believed, self._motors.angles)
        self._parked = False
        self._park()
        self._begin(simulation)

    def detach(self) -> None:
        """Let go."""
        super().detach()
        self.encoders.detach()

    def _control(self) -> None:
        self._motors.count()
        super()._control()

    def _move(self, period: float) -> None:
        """Steered wheels first turn to where the velocity asks them to; meanwhile it stays what it was."""
        self._parked, self._still_for = False, 0.0
        velocity = self._accelerated(period)
        angles = self._drive.steering_angles(velocity, self._motors.steering)
        if self._motors.steer(angles) > ASTRAY:
            self._motors.drive(np.zeros(len(self._model.wheel_joints)))
            return
        self._commanded = velocity
        self._motors.drive(self._drive.wheel_speeds(velocity, self._motors.steering))

    def _rest(self, period: float) -> None:
        if self._parked:
            return
        still = float(np.abs(self._motors.speeds).max()) * self._model.wheel_radius < 0.01
        self._still_for = self._still_for + period if still else 0.0
        if self._still_for >= PARK_AFTER:
            self._park()

    def _park(self) -> None:
        self._motors.park()
        self._parked = True

    @property
    def _wheels(self) -> int:
        return len(self._model.wheel_joints)

    @property
    def _motors(self) -> WheelMotors:
        if self._attached is None or not self._connection.present:
            raise NotConnectedError(f"{self.name} was used while the robot is not connected; call connect()")
        return self._attached

    @property
    def _heading(self) -> float:
        return self._odometry.heading

    @property
    def _travelled(self) -> float:
        return self._odometry.travelled

    def _update_odometry(self) -> None:
        positions = self.encoders.read().positions
        self._odometry.update(positions[: self._wheels], positions[self._wheels :])
