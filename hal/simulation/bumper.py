"""Simulated bumpers: contacts of chassis and wheels with anything but the floor, reported per strip."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.robot_model.sensor_parts import MountedBumper
from hal.api import Bumper, BumperReading, BumperZone
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation


class SimulatedBumper(SimulatedSensor[BumperReading], Bumper):
    """A bumper whose strips are pressed by a total inward force of ``threshold`` newtons at most ``height`` metres
    above the floor.

    ``fault``: makes readings fail.
    """

    def __init__(self, name: str, model: MountedBumper, _: np.random.Generator | None = None) -> None:
        super().__init__(name, model.part.rate, model.part.latency)
        self._mounted, self._model = model, model.part
        self.zones = tuple(BumperZone(start, end) for start, end in model.zones)
        self._middles = np.array([zone.middle for zone in self.zones])
        self._halves = np.array([(np.array(zone.end) - np.array(zone.start)) / 2 for zone in self.zones])

    def begin(self, simulation: Simulation) -> Callable[[], BumperReading]:
        """Return a function that reads the pressed strips."""
        reader = simulation.reader(ReadPurpose.SENSOR)
        links = {simulation.holder(self._model.frame), *simulation.joints(self._mounted.joints)}
        return lambda: self._measure(simulation, reader, frozenset(links))

    def _measure(self, simulation: Simulation, reader: Reader, links: frozenset[int]) -> BumperReading:
        robot, floor = simulation.built.robot, simulation.built.floor
        forces = np.zeros(len(self.zones))
        base_from_map = None
        for contact in simulation.contacts(reader):
            first_body, second_body, first_link, second_link, on_first, on_second, *_ = contact
            if first_body == robot and first_link in links and second_body not in (robot, floor):
                point = on_first
            elif second_body == robot and second_link in links and first_body not in (robot, floor):
                point = on_second
            else:
                continue
            if contact.pressure <= 0.0 or point[2] > self._model.height:
                continue
            if base_from_map is None:
                base_from_map = simulation.link_pose(reader, simulation.model.base_frame).to_pose2d().inverse()
            forces[self._nearest(base_from_map.apply(np.array(point[:2])))] += contact.pressure
        pressed = tuple(int(zone) for zone in np.flatnonzero(forces >= self._model.threshold))
        return BumperReading(pressed, simulation.now)

    def _nearest(self, point: NDArray[np.float64]) -> int:
        offsets = point - self._middles
        along = np.einsum("ij,ij->i", offsets, self._halves) / np.einsum("ij,ij->i", self._halves, self._halves)
        nearest = self._middles + np.clip(along, -1.0, 1.0)[:, None] * self._halves
        return int(np.argmin(np.linalg.norm(point - nearest, axis=1)))
