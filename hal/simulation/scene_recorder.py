"""Snapshots of a whole scene for recordings and pictures; not accessible to skills."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import Pose
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot


@dataclass(frozen=True, eq=False)
class SceneSnapshot:
    """The poses of everything at ``stamp``, seconds: poses in the map frame, joint positions by name.
    ``articulation_poses``: door or drawer, ``furniture/name`` → map_from_articulation, a frame at the joint with the
    furniture's orientation while closed. ``walker_poses``: of people, on the floor, upright.
    """

    stamp: float
    base_pose: Pose
    joint_positions: Mapping[str, float]
    object_poses: Mapping[str, Pose]
    articulation_poses: Mapping[str, Pose]
    walker_poses: Mapping[str, Pose] = field(default_factory=dict)


class SceneRecorder:
    """Takes snapshots for the runtime's recorder; construct it before the first step, or it is not ``trusted``."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._simulation = robot.simulation
        self._reader = robot.simulation.reader(ReadPurpose.RECORDING)
        self.trusted = self._reader.trusted

    def scene_snapshot(self) -> SceneSnapshot:
        """Return the scene as it is now."""
        simulation = self._simulation
        poses = {}
        for name, body in simulation.built.objects.items():
            position, quaternion = self._reader.body_pose(body)
            poses[name] = Pose(np.array(position), np.array(quaternion))
        doors = {}
        for name, (body, link) in simulation.built.articulations.items():
            doors[name] = self._reader.link_pose(body, link)
        return SceneSnapshot(
            stamp=self._robot.clock.now(),
            base_pose=simulation.link_pose(self._reader, simulation.model.base_frame),
            joint_positions=dict(zip(simulation.joint_names, map(float, simulation.joint_states()[0]), strict=True)),
            object_poses=poses,
            articulation_poses=doors,
            walker_poses={name: self._walker_pose(*walker) for name, walker in simulation.built.walkers.items()},
        )

    def _walker_pose(self, body: int, slides: tuple[int, int]) -> Pose:
        """Return the pose of a walker, whose root is at the start of its route."""
        start, _ = self._reader.body_pose(body)
        x, y = self._reader.joint_states(body, slides)[0]
        return Pose(np.array(start) + np.array([x, y, 0.0]))
