"""The motors of a base: at its wheels, and at the joints that steer them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import BaseModel
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.simulation import Simulation

Array = NDArray[np.float64]


class WheelMotors:
    """Wheels (n,) turn at a speed or are held; steering joints (k,) follow angles at their own limited speed."""

    def __init__(self, simulation: Simulation, model: BaseModel, parameters: PhysicsParameters) -> None:
        self._simulation, self._model, self._parameters = simulation, model, parameters
        self._wheels = simulation.slots(model.wheel_joints)
        self._steering = simulation.slots(model.steering_joints)
        self._wheel_indices = simulation.indices(model.wheel_joints)
        self._steering_indices = simulation.indices(model.steering_joints)
        self._steered_to = self.steering
        self._counted, self._speeds = self.angles.copy(), np.zeros(len(model.wheel_joints))

    def count(self) -> None:
        """Take the encoders' counts, once in a control period; speeds are what they tell from one to the next.

        A motor that holds its wheel against friction chatters by hundredths of a millimetre in every physics step:
        its speed at one instant is no speed of the base.
        """
        now = self.angles.copy()
        self._speeds = (now - self._counted) / self._parameters.control_period
        self._counted = now

    @property
    def angles(self) -> Array:
        """Measured angles of the wheels, (n,) rad."""
        values: Array = self._simulation.joint_states()[0, self._wheels]
        return values

    @property
    def speeds(self) -> Array:
        """Measured speeds of the wheels over the last control period, (n,) rad/s."""
        return self._speeds

    @property
    def steering(self) -> Array:
        """Measured angles of the steering joints, (k,) rad."""
        values: Array = self._simulation.joint_states()[0, self._steering]
        return values

    def steer(self, angles: Array) -> float:
        """Turn the steering joints towards ``angles`` (k,); how far the farthest of them is away, radians."""
        if not len(angles):
            return 0.0
        step = self._model.steering_speed * self._parameters.control_period
        self._steered_to = self._steered_to + np.clip(angles - self._steered_to, -step, step)
        self._hold(self._steering_indices, self._steered_to, self._model.steering_torque, gain=0.3)
        return float(np.abs(angles - self.steering).max())

    def drive(self, speeds: Array) -> None:
        """Turn the wheels at ``speeds`` (n,), rad/s."""
        self._simulation.client.setJointMotorControlArray(
            self._simulation.built.robot,
            self._wheel_indices,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds.tolist(),
            forces=[self._model.wheel_torque] * len(self._wheel_indices),
        )

    def park(self) -> None:
        """Hold wheels and steering where they are: a velocity motor at zero gives way under the arm."""
        self._hold(self._wheel_indices, self.angles, self._model.wheel_torque, self._parameters.wheel_hold_gain)
        self._steered_to = self.steering
        self.steer(self._steered_to)

    def _hold(self, indices: list[int], angles: Array, torque: float, gain: float) -> None:
        self._simulation.client.setJointMotorControlArray(
            self._simulation.built.robot,
            indices,
            pybullet.POSITION_CONTROL,
            targetPositions=angles.tolist(),
            forces=[torque] * len(indices),
            positionGains=[gain] * len(indices),
        )
