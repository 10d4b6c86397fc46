"""Simulated force-torque sensors: the balance of forces on all that hangs on the sensor.

Bullet's own joint feedback leaves out most of what the gear between two fingers carries, so a bar that pushes the
fingers aside would hardly be felt; contacts, weight and inertia give the same wrench completely.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Wrench
from bestman_bt.robot_model import MountedForceTorque
from hal.api import ForceTorque
from hal.pybullet.client import Reader, ReadPurpose, SimulationError
from hal.pybullet.sensor_pipeline import SimulatedSensor
from hal.pybullet.simulation import Simulation

GRAVITY = 9.81
OLDEST_PREVIOUS = 0.05  # seconds back to which the rate of the momentum is taken

Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class _Motion:
    """Of all that is carried: momentum and the moment of it about the map's origin, (6,), at ``stamp``."""

    momentum: NDArray[np.float64]
    stamp: float


class SimulatedForceTorque(SimulatedSensor[Wrench], ForceTorque):
    """Measures when asked, at most ``rate`` times a second.

    The wrench is what the world does to all that hangs on the sensor, weight and inertia included, about the
    origin of ``frame`` and along its axes: a hand that hangs straight down pulls with +m g along z. Contact forces are
    those of the last physics step, inertia is the mean since the reading before. What pads resist twisting with
    (spinning friction) is missing from the torque: Bullet does not tell it. ``line.fault`` makes it fail.
    """

    def __init__(self, name: str, model: MountedForceTorque, rng: np.random.Generator) -> None:
        super().__init__(name, model.part.rate, model.part.latency, on_demand=True)
        self._mounted, self._model, self._rng = model, model.part, rng
        self.frame = model.part.frame
        self._offset = rng.standard_normal(6) * np.repeat([model.part.offset_force, model.part.offset_torque], 3)
        self._masses: dict[int, float] = {}
        self._latest: Wrench | None = None
        self._motion: _Motion | None = None

    def wrench(self) -> Wrench:
        """The latest wrench, with offset and noise."""
        return self.line.read()

    def begin(self, simulation: Simulation) -> Callable[[], Wrench]:
        """Find what hangs on the sensor."""
        built, client = simulation.built, simulation.client
        missing = [joint for joint in self._mounted.joints if joint not in built.joints]
        if missing or not self._mounted.joints:
            raise SimulationError(f"{self.name} carries nothing that has a shape ({', '.join(missing) or 'no joint'})")
        carried = {built.joints[joint] for joint in self._mounted.joints}
        for index in range(client.getNumJoints(built.robot)):  # parents come before children
            if client.getJointInfo(built.robot, index)[16] in carried:
                carried.add(index)
        self._masses = {index: client.getDynamicsInfo(built.robot, index)[0] for index in sorted(carried)}
        self._latest = self._motion = None
        reader = client.reader(ReadPurpose.SENSOR)
        return lambda: self._measure(simulation, reader)

    def _measure(self, simulation: Simulation, reader: Reader) -> Wrench:
        model, now = self._model, simulation.now
        if self._latest is None or self._reading(now) > self._reading(self._latest.stamp):
            values = self._load(simulation, reader) + self._offset
            values += np.repeat([model.noise_force, model.noise_torque], 3) * self._rng.standard_normal(6)
            most = np.repeat([model.max_force, model.max_torque], 3)
            values = np.clip(values, -most, most)
            self._latest = Wrench(values[:3], values[3:], now)
        return self._latest

    def _reading(self, stamp: float) -> int:
        return math.floor(stamp * self._model.rate + 1e-6)

    def _load(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Force and torque (6,) in the sensor's frame."""
        pose = simulation.link_pose(reader, self._model.frame)
        load = self._weight_and_inertia(simulation, reader) + self._contacts(simulation, reader)
        turned: NDArray[np.float64] = load.reshape(2, 3) @ pose.rotation  # of both: rotation.T @ vector
        arm: NDArray[np.float64] = pose.rotation.T @ pose.position
        turned[1] -= _cross(arm.tolist(), turned[0].tolist())
        return turned.ravel()

    def _contacts(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Force and moment about the map's origin of what touches from outside, (6,)."""
        robot, carried = simulation.built.robot, self._masses
        fx = fy = fz = mx = my = mz = 0.0
        # All contacts are asked for: of one body alone, Bullet may swap the two of a contact, but not their friction.
        for contact in simulation.contacts(reader):
            first = contact[1] == robot and contact[3] in carried
            second = contact[2] == robot and contact[4] in carried
            if first == second:
                continue
            _, _, _, _, _, point, _, normal, _, press, slip, along, slip2, along2 = contact
            if second:  # Bullet tells the push on the first body
                press, slip, slip2 = -press, -slip, -slip2
            push = (
                press * normal[0] + slip * along[0] + slip2 * along2[0],
                press * normal[1] + slip * along[1] + slip2 * along2[1],
                press * normal[2] + slip * along[2] + slip2 * along2[2],
            )
            moment = _cross(point, push)
            fx, fy, fz = fx + push[0], fy + push[1], fz + push[2]
            mx, my, mz = mx + moment[0], my + moment[1], mz + moment[2]
        return np.array((fx, fy, fz, mx, my, mz))

    def _weight_and_inertia(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Force, and moment about the map's origin, (6,); spins of the single links count for nothing."""
        wx = wy = wz = px = py = pz = hx = hy = hz = 0.0
        states = reader.getLinkStates(simulation.built.robot, list(self._masses), computeLinkVelocity=1)
        for mass, state in zip(self._masses.values(), states, strict=True):
            (x, y, _), (u, v, w) = state[0], state[6]
            turning = _cross(state[0], (u, v, w))
            wx, wy, wz = wx - mass * GRAVITY * y, wy + mass * GRAVITY * x, wz - mass * GRAVITY
            px, py, pz = px + mass * u, py + mass * v, pz + mass * w
            hx, hy, hz = hx + mass * turning[0], hy + mass * turning[1], hz + mass * turning[2]
        load = np.array((0.0, 0.0, wz, wx, wy, 0.0))
        motion = _Motion(np.array((px, py, pz, hx, hy, hz)), simulation.now)
        before, self._motion = self._motion, motion
        if before is not None and 0.0 < motion.stamp - before.stamp <= OLDEST_PREVIOUS:
            load -= (motion.momentum - before.momentum) / (motion.stamp - before.stamp)
        return load


def _cross(a: Sequence[float], b: Sequence[float]) -> Vector:
    """Of two triples: numpy's takes twenty times as long, and this is asked for each contact of each reading."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
