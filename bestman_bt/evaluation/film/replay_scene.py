"""A copy of a run's world for rendering recorded snapshots.

It is not a simulation: poses are set and no time passes. The judged run has ended before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.messages import Pose, wrap_angle
from bestman_bt.registry import DRIVERS
from bestman_bt.robot_model.model import GripperModel
from bestman_bt.scene.scene import Articulation, PlacedFurniture
from bestman_bt.visualization.snapshot import RobotSnapshot
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import smooth
from hal.simulation.guards import ReadPurpose
from hal.simulation.robot import SimulatedRobot


class ReplayScene:
    """A context manager that holds its own connection."""

    def __init__(self, run: FilmedRun) -> None:
        simulated: type[SimulatedRobot] = DRIVERS.resolve(DEFAULT_SIMULATOR)
        self._robot = simulated(run.robot_model, run.world, seed=run.config.seed)
        gripper = next(iter(run.robot_model.of(GripperModel).values()), None)
        self._hand = run.robot_model.base_frame if gripper is None else gripper.hand_link
        self._shown = (self._hand,) if gripper is None else (*gripper.part.finger_links, gripper.hand_link)
        self._leaves = {
            f"{p.name}/{leaf.name}": (p, leaf) for p in run.world.furniture for leaf in p.model.articulations
        }
        self._starts = {walker.name: walker.route[0] for walker in run.world.walkers}

    def __enter__(self) -> ReplayScene:
        self._robot.connect()
        self._reader = self._robot.simulation.reader(ReadPurpose.RECORDING)
        return self

    def __exit__(self, *_: object) -> None:
        self._robot.disconnect()

    def set(self, snapshot: RobotSnapshot) -> None:
        """Set the poses of a snapshot. Raises FilmError if the robot has changed since the run."""
        simulation = self._robot.simulation
        engine, built = simulation.engine, simulation.built
        for name, pose in snapshot.body_poses.items():
            if name in self._leaves:
                engine.set_joint(*built.articulations[name], opening(*self._leaves[name], pose))
            elif name in self._starts:
                body, slides = built.walkers[name]
                for slide, value in zip(slides, pose.position[:2] - np.array(self._starts[name]), strict=True):
                    engine.set_joint(body, slide, float(value))
            else:
                body = built.objects[name]
                engine.put(body, pose.position.tolist(), pose.quaternion.tolist())
        now = simulation.link_pose(self._reader, simulation.model.base_frame)
        position, quaternion = self._reader.body_pose(built.robot)
        root = snapshot.map_from_base @ now.inverse() @ Pose(np.array(position), np.array(quaternion))
        engine.put(built.robot, root.position.tolist(), root.quaternion.tolist())
        unknown = set(snapshot.joint_positions) - set(built.joints)
        if unknown:
            raise FilmError(f"the robot has changed since the run: it has no joint {', '.join(sorted(unknown))}")
        for name, value in snapshot.joint_positions.items():
            engine.set_joint(built.robot, built.joints[name], value)

    def hand(self) -> NDArray[np.float64]:
        """Return the position of the hand, or of the base of a robot without one, (3,) metres."""
        return self._robot.simulation.link_pose(self._reader, self._hand).position

    def seen(
        self, viewpoint: Viewpoint, subjects: Sequence[str], width: int = 160, height: int = 120
    ) -> tuple[float, float]:
        """Return the fractions of an image that show the fingers and ``subjects`` (objects, doors or drawers)."""
        built = self._robot.simulation.built
        bodies, links = self._reader.segments(viewpoint, width, height)
        hand = [built.links[link] for link in self._shown if link in built.links]
        of_hand = (bodies == built.robot) & np.isin(links, hand)
        of_subjects = np.zeros_like(of_hand)
        for name in subjects:
            if name in built.objects:
                of_subjects |= bodies == built.objects[name]
            elif name in built.articulations:
                body, link = built.articulations[name]
                of_subjects |= (bodies == body) & (links == link)
        return float(np.mean(of_hand)), float(np.mean(of_subjects))

    def picture(self, viewpoint: Viewpoint, width: int, height: int, oversampling: int = 1) -> NDArray[np.uint8]:
        """Render the scene: (height, width, 3) uint8."""
        return smooth(self._reader.photo(viewpoint, width * oversampling, height * oversampling), oversampling)


def opening(furniture: PlacedFurniture, leaf: Articulation, map_from_leaf: Pose) -> float:
    """Return the opening of a door or drawer, radians or metres, for the frame at its joint."""
    closed = furniture.pose @ Pose(np.array(leaf.origin))
    moved = closed.inverse() @ map_from_leaf
    axis = np.asarray(leaf.axis)
    if leaf.kind == "prismatic":
        return float(moved.position @ axis)
    return wrap_angle(2.0 * math.atan2(float(moved.quaternion[:3] @ axis), float(moved.quaternion[3])))
