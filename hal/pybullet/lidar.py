"""Simulated planar lidars: one batch of rays per scan."""

from __future__ import annotations

import numpy as np

from bestman_bt.messages import LaserScan
from bestman_bt.robot_model import LidarModel
from hal.api import Lidar
from hal.pybullet.client import Reader, ReadPurpose
from hal.pybullet.reading_line import ReadingLine
from hal.pybullet.simulation import Simulation


class SimulatedLidar(Lidar):
    """Casts its beams when asked; a beam that the robot's own body blocks sees nothing. ``line.fault``: it fails."""

    def __init__(self, name: str, model: LidarModel, rng: np.random.Generator) -> None:
        super().__init__(name)
        self._model, self._rng = model, rng
        self.line: ReadingLine[LaserScan] = ReadingLine(name, model.rate, model.latency, on_demand=True)
        angles = model.angle_min + (model.angle_max - model.angle_min) / model.beams * np.arange(model.beams)
        self._directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(model.beams)])

    @property
    def frame(self) -> str:
        """The frame of the scans."""
        return self._model.frame

    def scan(self) -> LaserScan:
        """One scan; noise is normal, with the model's standard deviation."""
        return self.line.read()

    def attach(self, simulation: Simulation) -> None:
        """Scan in this simulation."""
        reader = simulation.client.reader(ReadPurpose.SENSOR)
        self.line.attach(simulation, lambda: self._cast(simulation, reader))

    def detach(self) -> None:
        """Let go."""
        self.line.detach()

    def _cast(self, simulation: Simulation, reader: Reader) -> LaserScan:
        model = self._model
        pose = simulation.link_pose(reader, model.frame)
        directions = self._directions @ pose.rotation.T
        starts = pose.position + directions * model.range_min
        ends = pose.position + directions * model.range_max
        hits = reader.rayTestBatch(starts.tolist(), ends.tolist(), numThreads=1)
        bodies, _, shares, _, _ = (np.array(column) for column in zip(*hits, strict=True))
        ranges = model.range_min + shares * (model.range_max - model.range_min)
        ranges = ranges + self._rng.standard_normal(model.beams) * model.noise
        seen = (
            (bodies >= 0)
            & (bodies != simulation.built.robot)
            & (ranges >= model.range_min)
            & (ranges <= model.range_max)
        )
        return LaserScan(
            ranges=np.where(seen, ranges, np.inf),
            angle_min=model.angle_min,
            angle_increment=(model.angle_max - model.angle_min) / model.beams,
            range_min=model.range_min,
            range_max=model.range_max,
            stamp=simulation.now,
        )
