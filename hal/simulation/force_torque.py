"""Simulated force-torque sensors: the balance of forces on everything mounted on the sensor.

Bullet's own joint feedback omits most of the load on the gear between two fingers, so a bar that pushes the fingers
sideways would hardly be measured; contacts, weight and inertia give the complete wrench.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import GRAVITY, Wrench
from bestman_bt.robot_model.sensor_parts import MountedForceTorque
from hal.api import ForceTorque
from hal.simulation.bodies import SimulationError, Vector
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation

OLDEST_PREVIOUS = 0.05  # seconds back to which the rate of the momentum is taken


@dataclass(frozen=True, eq=False)
class _Motion:
    """Momentum of everything that is carried, and its moment about the map's origin, (6,), at ``stamp``."""

    momentum: NDArray[np.float64]
    stamp: float


class SimulatedForceTorque(SimulatedSensor[Wrench], ForceTorque):
    """A force-torque sensor that measures on request, at most ``rate`` times a second.

    The wrench is exerted by the environment on everything that the sensor carries, including weight and inertia, about
    the origin of ``frame`` and along its axes: a hand that points straight down gives +m g along z. Contact forces are
    those of the last physics step, inertia is the mean since the previous reading. Spinning friction of the pads is
    missing from the torque, because Bullet does not report it. ``fault`` makes it fail.
    """

    def __init__(self, name: str, model: MountedForceTorque, rng: np.random.Generator) -> None:
        super().__init__(name, model.part.rate, model.part.latency, on_demand=True)
        self._mounted, self._model, self._rng = model, model.part, rng
        self.frame = model.part.frame
        self._offset = rng.standard_normal(6) * np.repeat([model.part.offset_force, model.part.offset_torque], 3)
        self._masses: dict[int, float] = {}
        self._measured: Wrench | None = None
        self._motion: _Motion | None = None

    def wrench(self) -> Wrench:
        """Return the latest wrench, with offset and noise."""
        return self.read()

    def begin(self, simulation: Simulation) -> Callable[[], Wrench]:
        """Find the links that the sensor carries."""
        built = simulation.built
        missing = [joint for joint in self._mounted.joints if joint not in built.joints]
        if missing or not self._mounted.joints:
            raise SimulationError(f"{self.name} carries nothing that has a shape ({', '.join(missing) or 'no joint'})")
        self._masses = {link: built.link_masses[link] for link in built.below(self._mounted.joints)}
        self._measured = self._motion = None
        reader = simulation.reader(ReadPurpose.SENSOR)
        return lambda: self._measure(simulation, reader)

    def _measure(self, simulation: Simulation, reader: Reader) -> Wrench:
        model, now = self._model, simulation.now
        if self._measured is None or self._reading(now) > self._reading(self._measured.stamp):
            values = self._load(simulation, reader) + self._offset
            values += np.repeat([model.noise_force, model.noise_torque], 3) * self._rng.standard_normal(6)
            most = np.repeat([model.max_force, model.max_torque], 3)
            values = np.clip(values, -most, most)
            self._measured = Wrench(values[:3], values[3:], now)
        return self._measured

    def _reading(self, stamp: float) -> int:
        return math.floor(stamp * self._model.rate + 1e-6)

    def _load(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Return force and torque (6,) in the sensor's frame, newtons and N m."""
        pose = simulation.link_pose(reader, self._model.frame)
        load = self._weight_and_inertia(simulation, reader) + self._contacts(simulation, reader)
        turned: NDArray[np.float64] = load.reshape(2, 3) @ pose.rotation  # of both: rotation.T @ vector
        arm: NDArray[np.float64] = pose.rotation.T @ pose.position
        turned[1] -= _cross(arm.tolist(), turned[0].tolist())
        return turned.ravel()

    def _contacts(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Return force and moment (6,) of outside contacts about the map's origin."""
        robot, carried = simulation.built.robot, self._masses
        fx = fy = fz = mx = my = mz = 0.0
        # All contacts are asked for: of one body alone, Bullet may swap the two of a contact, but not their friction.
        for contact in simulation.contacts(reader):
            first = contact.first == robot and contact.first_link in carried
            second = contact.second == robot and contact.second_link in carried
            if first == second:
                continue
            x, y, z = contact.force()
            push = (-x, -y, -z) if second else (x, y, z)
            moment = _cross(contact.on_first, push)
            fx, fy, fz = fx + push[0], fy + push[1], fz + push[2]
            mx, my, mz = mx + moment[0], my + moment[1], mz + moment[2]
        return np.array((fx, fy, fz, mx, my, mz))

    def _weight_and_inertia(self, simulation: Simulation, reader: Reader) -> NDArray[np.float64]:
        """Return force and moment (6,) of weight and inertia about the map's origin; spins of the single links are
        neglected.
        """
        wx = wy = wz = px = py = pz = hx = hy = hz = 0.0
        motions = reader.link_motions(simulation.built.robot, self._masses)
        for mass, (position, (u, v, w), _) in zip(self._masses.values(), motions, strict=True):
            x, y, _ = position
            turning = _cross(position, (u, v, w))
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
    """Return the cross product of two triples: numpy's takes twenty times as long, and each contact of each reading
    needs one.
    """
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
