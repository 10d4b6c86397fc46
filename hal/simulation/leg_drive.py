"""Bases on legs as a channel: joint torques at the physics rate, odometry from legs and inertial unit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY, Twist2D
from bestman_bt.robot_model.model import LeggedBaseModel
from bestman_bt.robot_model.payload import Payload
from hal.api import Imu, NoDataError
from hal.parts.channels import BaseChannel, BaseReading
from hal.parts.legged.walker import TrotGait
from hal.simulation.parameters import SimulationParameters
from hal.simulation.simulation import SimulatedChannel, Simulation

LEGS_CANNOT = {
    "velocities of a base lapse": "legs report the mean over a step of 0.3 s, longer than the dead-man timeout",
    "a base moves in its own frame": "legs sway: by up to 3 cm aside in the second after their first two steps",
    "a base drives and turns by odometry": "legs stop where feet land, within 2 cm, and wander by up to 4 cm in a turn",
    "a motion of a base can be cancelled": "legs sway for up to 0.7 s after cancel(), by up to 0.03 m/s or rad/s",
}
"""Features of the Robotics API, and conformance checks, that this walker does not support → reason."""


class LegDrive(SimulatedChannel, BaseChannel):
    """A walking base that trots. It uses only its joints and its IMU. ``body``: of the whole robot."""

    def __init__(self, model: LeggedBaseModel, parameters: SimulationParameters, imu: Imu, body: Payload) -> None:
        self._model, self._parameters, self._imu, self._body = model, parameters, imu, body
        self._slots: NDArray[np.intp] = np.zeros(0, np.intp)
        self._indices: list[int] = []
        self._velocity = np.zeros(3)
        self._walker = TrotGait(model, body)

    def attach(self, simulation: Simulation) -> None:
        """Stand up, with odometry at zero."""
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
