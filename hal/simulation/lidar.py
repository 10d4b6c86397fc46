"""Simulated planar lidars: one batch of rays per scan."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import LaserScan, Pose
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.robot_model.sensor_parts import LidarPart
from bestman_bt.robot_model.urdf_tree import joints_above
from hal.api import Lidar
from hal.simulation.guards import Reader, ReadPurpose
from hal.simulation.sensor_pipeline import SimulatedSensor
from hal.simulation.simulation import Simulation


class SimulatedLidar(SimulatedSensor[LaserScan], Lidar):
    """Casts its beams on request; beams blocked by the robot's own body have no hit. ``fault`` makes it fail.

    A lidar built into a base looks out through a slot: its beams begin at the outline of the base.
    """

    def __init__(self, name: str, model: LidarPart, rng: np.random.Generator) -> None:
        super().__init__(name, model.rate, model.latency, on_demand=True)
        self.frame, self._model, self._rng = model.frame, model, rng
        angles = model.angle_min + (model.angle_max - model.angle_min) / model.beams * np.arange(model.beams)
        self._directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(model.beams)])

    def scan(self) -> LaserScan:
        """Return one scan; noise is normal, with the model's standard deviation."""
        return self.read()

    def begin(self, simulation: Simulation) -> Callable[[], LaserScan]:
        """Compute the origins of the beams."""
        reader = simulation.reader(ReadPurpose.SENSOR)
        starts = np.full(self._model.beams, self._model.range_min)
        if not joints_above(simulation.model, self._model.frame) & set(simulation.joint_names):
            lidar = simulation.link_pose(reader, self._model.frame)
            for base in simulation.model.of(BaseModel).values():
                base_from_lidar = simulation.link_pose(reader, base.frame).inverse() @ lidar
                starts = np.maximum(starts, self._leaving(np.array(base.footprint), base_from_lidar))
        return lambda: self._cast(simulation, reader, starts)

    def _leaving(self, outline: NDArray[np.float64], base_from_lidar: Pose) -> NDArray[np.float64]:
        """Return the distance (N,), metres, along each beam to where it leaves a convex outline (M, 2); 0 where it
        begins beyond it.
        """
        edges = np.roll(outline, -1, axis=0) - outline
        normals = np.column_stack([edges[:, 1], -edges[:, 0]])
        room = np.einsum("ij,ij->i", normals, outline) - normals @ base_from_lidar.position[:2]
        towards = (self._directions @ base_from_lidar.rotation.T)[:, :2] @ normals.T
        exits = np.where(towards > 0.0, room / np.where(towards > 0.0, towards, 1.0), np.inf).min(axis=1)
        return np.where(room.min() > 0.0, exits, 0.0)

    def _cast(self, simulation: Simulation, reader: Reader, nearest: NDArray[np.float64]) -> LaserScan:
        model = self._model
        pose = simulation.link_pose(reader, model.frame)
        directions = self._directions @ pose.rotation.T
        starts = pose.position + directions * nearest[:, None]
        ends = pose.position + directions * model.range_max
        bodies, shares = reader.cast_rays(starts, ends)
        ranges = nearest + shares * (model.range_max - nearest)
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
