"""Simulated tactile pads: contact points of a finger, spread by a soft skin over the taxels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.sensor_parts import TactilePart
from hal.api import Tactile, TactileReading
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.joint_motors import FrameMotion, FrameTracker, body_velocity_at
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation

FACING = 0.7
"""Cosine of the largest angle between the pad's normal and an acting force: forces from the side or from behind do not
act on the pad.
"""

Array = NDArray[np.float64]


class SimulatedTactile(SimulatedSensor[TactileReading], Tactile):
    """A tactile pad: measures the contacts of its link that lie on the pad and press on it.

    The skin spreads each of them over the taxels (a normal distribution cut off at the pad's edge), so that the sum of
    the taxels is the force. The sliding speed is the mean of the contacts, weighted by their force. ``fault``
    makes it fail.
    """

    def __init__(self, name: str, model: TactilePart, rng: np.random.Generator) -> None:
        super().__init__(name, model.rate, model.latency)
        self.frame, self._model, self._rng = model.frame, model, rng
        width, height = model.size
        self._x = (np.arange(model.columns) + 0.5) / model.columns * width - width / 2
        self._y = (np.arange(model.rows) + 0.5) / model.rows * height - height / 2

    def begin(self, simulation: Simulation) -> Callable[[], TactileReading]:
        """Return the reader of the pad's contacts."""
        reader = simulation.reader(ReadPurpose.SENSOR)
        link = simulation.holder(self._model.frame)
        tracker = FrameTracker(simulation, reader, self._model.frame)
        return lambda: self._measure(simulation, reader, link, tracker.look())

    def _measure(self, simulation: Simulation, reader: Reader, link: int, motion: FrameMotion) -> TactileReading:
        model = self._model
        rotation, robot = motion.pose.rotation, simulation.built.robot
        forces = np.zeros((model.rows, model.columns, 3))
        sliding, pressing = np.zeros(2), 0.0
        for contact in simulation.contacts(reader):
            first = contact.first == robot and contact.first_link == link
            second = contact.second == robot and contact.second_link == link
            if first == second:
                continue
            sense = 1.0 if first else -1.0
            point = np.array(contact.on_first if first else contact.on_second)
            force = rotation.T @ (sense * np.array(contact.force()))
            place = rotation.T @ (point - motion.pose.position)
            normal = rotation.T @ (sense * np.array(contact.normal))
            if contact.pressure <= 0.0 or normal[2] > -FACING or not self._on_pad(place):
                continue
            forces += self._shares(place)[:, :, None] * force
            other = (contact.second, contact.second_link) if first else (contact.first, contact.first_link)
            velocity = body_velocity_at(reader, *other, point) - motion.velocity_at(point)
            sliding += -force[2] * (rotation.T @ velocity)[:2]
            pressing -= force[2]
        if pressing > 0.0:
            sliding = sliding / pressing + model.noise_sliding * self._rng.standard_normal(2)
        forces += model.noise * self._rng.standard_normal(forces.shape)
        return TactileReading(-forces[..., 2], forces[..., :2], sliding, simulation.now)

    def _on_pad(self, place: Array) -> bool:
        width, height = self._model.size
        margin = self._model.spread
        return bool(abs(place[0]) <= width / 2 + margin and abs(place[1]) <= height / 2 + margin)

    def _shares(self, place: Array) -> Array:
        """Return the fraction of a pressure point that each taxel feels, (rows, columns); the sum is 1."""
        along_x = np.exp(-0.5 * ((self._x - place[0]) / self._model.spread) ** 2)
        along_y = np.exp(-0.5 * ((self._y - place[1]) / self._model.spread) ** 2)
        shares = np.outer(along_y, along_x)
        return np.asarray(shares / shares.sum())
