"""Simulated force-torque sensors: the balance of forces on all that hangs on the sensor.

Bullet's own joint feedback leaves out most of what the gear between two fingers carries, so a bar that pushes the
fingers aside would hardly be felt; contacts, weight and inertia give the same wrench completely.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Wrench
from bestman_bt.robot_model import ForceTorqueModel
from hal.api import ForceTorque, NotConnectedError
from hal.pybullet.client import Reader, ReadPurpose, SimulationError
from hal.pybullet.simulation import Simulation

GRAVITY = np.array([0.0, 0.0, -9.81])
OLDEST_PREVIOUS = 0.05  # seconds back to which the rate of the momentum is taken


@dataclass(frozen=True, eq=False)
class _Motion:
    """Of all that is carried: ``momentum``, ``moment`` of it about the map's origin, at ``stamp``."""

    momentum: NDArray[np.float64]
    moment: NDArray[np.float64]
    stamp: float


class SimulatedForceTorque(ForceTorque):
    """Measures when asked, at most ``rate`` times a second.

    The wrench is what the world does to all that hangs on the sensor, weight and inertia included, about the
    origin of ``frame`` and along its axes: a hand that hangs straight down pulls with +m g along z. Contact forces are
    those of the last physics step, inertia is the mean since the reading before. What pads resist twisting with
    (spinning friction) is missing from the torque: Bullet does not tell it.
    """

    def __init__(self, name: str, model: ForceTorqueModel, rng: np.random.Generator) -> None:
        super().__init__(name)
        self._model, self._rng = model, rng
        self._offset = rng.standard_normal(6) * np.repeat([model.offset_force, model.offset_torque], 3)
        self._simulation: Simulation | None = None
        self._reader: Reader | None = None
        self._masses: dict[int, float] = {}
        self._latest: Wrench | None = None
        self._motion: _Motion | None = None

    @property
    def frame(self) -> str:
        """The frame of the wrenches."""
        return self._model.frame

    def wrench(self) -> Wrench:
        """The latest wrench, with offset and noise."""
        if self._simulation is None or self._reader is None:
            raise NotConnectedError(f"{self.name} was used while the robot is not connected; call connect()")
        model, now = self._model, self._simulation.now
        if self._latest is None or self._reading(now) > self._reading(self._latest.stamp):
            values = self._load(self._simulation, self._reader) + self._offset
            values += np.repeat([model.noise_force, model.noise_torque], 3) * self._rng.standard_normal(6)
            most = np.repeat([model.max_force, model.max_torque], 3)
            values = np.clip(values, -most, most)
            self._latest = Wrench(values[:3], values[3:], now)
        return self._latest

    def attach(self, simulation: Simulation) -> None:
        """Find what hangs on the sensor."""
        built, client = simulation.built, simulation.client
        missing = [joint for joint in self._model.joints if joint not in built.joints]
        if missing or not self._model.joints:
            raise SimulationError(f"{self.name} carries nothing that has a shape ({', '.join(missing) or 'no joint'})")
        carried = {built.joints[joint] for joint in self._model.joints}
        for index in range(client.getNumJoints(built.robot)):  # parents come before children
            if client.getJointInfo(built.robot, index)[16] in carried:
                carried.add(index)
        self._masses = {index: client.getDynamicsInfo(built.robot, index)[0] for index in sorted(carried)}
        self._simulation, self._reader = simulation, client.reader(ReadPurpose.SENSOR)
        self._latest = self._motion = None

    def detach(self) -> None:
        """Let go."""
        self._simulation = self._reader = self._latest = self._motion = None

    def _reading(self, stamp: float) -> int:
        return math.floor(stamp * self._model.rate + 1e-6)

    def _load(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Force and torque (6,) in the sensor's frame."""
        pose = simulation.link_pose(reader, self._model.frame)
        force, moment = self._weight_and_inertia(simulation, reader)
        robot = simulation.built.robot
        # All contacts are asked for: of one body alone, Bullet may swap the two of a contact, but not their friction.
        for contact in reader.getContactPoints():
            first = contact[1] == robot and contact[3] in self._masses
            second = contact[2] == robot and contact[4] in self._masses
            if first != second:
                push = contact[9] * np.array(contact[7])  # on the first body
                push = push + contact[10] * np.array(contact[11]) + contact[12] * np.array(contact[13])
                push = push if first else -push
                force += push
                moment += np.cross(contact[5], push)
        torque = moment - np.cross(pose.position, force)
        return np.concatenate([pose.rotation.T @ force, pose.rotation.T @ torque])

    def _weight_and_inertia(
        self, simulation: Simulation, reader: Reader
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Force, and moment about the map's origin; spins of the single links count for nothing."""
        force, moment, momentum, turning = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
        indices = list(self._masses)
        states = reader.getLinkStates(simulation.built.robot, indices, computeLinkVelocity=1)
        for index, state in zip(indices, states, strict=True):
            weight = self._masses[index] * GRAVITY
            force += weight
            moment += np.cross(state[0], weight)
            moved = self._masses[index] * np.array(state[6])
            momentum += moved
            turning += np.cross(state[0], moved)
        before, self._motion = self._motion, _Motion(momentum, turning, simulation.now)
        if before is not None and 0.0 < simulation.now - before.stamp <= OLDEST_PREVIOUS:
            passed = simulation.now - before.stamp
            force -= (momentum - before.momentum) / passed
            moment -= (turning - before.moment) / passed
        return force, moment
