"""The motors of a base: at its wheels, and at the joints that steer them."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model import BasePart
from hal.pybullet.package import pybullet
from hal.pybullet.parameters import PhysicsParameters
from hal.pybullet.simulation import Simulation

Array = NDArray[np.float64]
SPEED_WINDOW = 1.0 / 60.0
"""Seconds between the two counts that a speed is told from, or a control period where that is longer."""


class WheelMotors:
    """Wheels (n,) turn at a speed or are held; steering joints (k,) follow angles at their own limited speed."""

    def __init__(self, simulation: Simulation, base: BasePart, parameters: PhysicsParameters) -> None:
        self._simulation, self._base, self._parameters = simulation, base, parameters
        self._wheels = simulation.slots(base.wheel_joints)
        self._steering = simulation.slots(base.steering_joints)
        self._wheel_indices = simulation.indices(base.wheel_joints)
        self._steering_indices = simulation.indices(base.steering_joints)
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
        self._hold(self._steering_indices, self._steered_to, self._base.steering_torque, gain=0.3)
        return float(np.abs(angles - self.steering).max())

    def drive(self, speeds: Array) -> None:
        """Turn the wheels at ``speeds`` (n,), rad/s."""
        self._simulation.client.setJointMotorControlArray(
            self._simulation.built.robot,
            self._wheel_indices,
            pybullet.VELOCITY_CONTROL,
            targetVelocities=speeds.tolist(),
            forces=[self._base.wheel_torque] * len(self._wheel_indices),
        )

    def park(self) -> None:
        """Hold wheels and steering where they are: a velocity motor at zero gives way under the arm."""
        self._hold(self._wheel_indices, self.angles, self._base.wheel_torque, self._parameters.wheel_hold_gain)
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
