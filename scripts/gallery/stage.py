"""A stage: a second copy of a run's world, in which everything is put where it was, and photographed.

It is no simulation: poses are set and no time runs. The judged run has ended before.
"""

from __future__ import annotations

import math
from types import TracebackType

import numpy as np
import pybullet
from numpy.typing import NDArray
from track import Moment

from bestman_bt.messages import Pose
from bestman_bt.runtime import Setup
from hal.pybullet import PyBulletRobot, Viewpoint
from hal.pybullet.client import ReadPurpose
from hal.pybullet.render import smooth_picture


class Stage:
    """Used as a context, in which it holds its own connection."""

    def __init__(self, setup: Setup) -> None:
        self._robot = PyBulletRobot(setup.robot_model, setup.world, seed=setup.config.seed)
        gripper = next(iter(setup.robot_model.grippers.values()))
        self._fingers = gripper.finger_links
        self._hand = gripper.hand_link

    def __enter__(self) -> Stage:
        self._robot.connect()
        self._reader = self._robot.simulation.client.reader(ReadPurpose.RECORDING)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._robot.disconnect()

    def set(self, moment: Moment) -> None:
        """Put everything where it was."""
        simulation = self._robot.simulation
        client, built, snapshot = simulation.client, simulation.built, moment.snapshot
        for name, pose in snapshot.object_poses.items():
            client.resetBasePositionAndOrientation(
                built.objects[name], pose.position.tolist(), pose.quaternion.tolist()
            )
        for name, value in moment.openings.items():
            client.resetJointState(*built.articulations[name], value)
        now = simulation.link_pose(self._reader, simulation.model.base_frame)
        position, quaternion = self._reader.getBasePositionAndOrientation(built.robot)
        root = snapshot.base_pose @ now.inverse() @ Pose(np.array(position), np.array(quaternion))
        client.resetBasePositionAndOrientation(built.robot, root.position.tolist(), root.quaternion.tolist())
        for name, value in snapshot.joint_positions.items():
            client.resetJointState(built.robot, built.joints[name], value)

    def hand(self) -> NDArray[np.float64]:
        """(3,) metres: where the hand is."""
        return self._robot.simulation.link_pose(self._reader, self._hand).position

    def seen(
        self, viewpoint: Viewpoint, subjects: list[str], width: int = 160, height: int = 120
    ) -> tuple[float, float]:
        """Shares of a small picture that show the fingers, and the subjects: objects, or doors and drawers."""
        built = self._robot.simulation.built
        view = pybullet.computeViewMatrix(viewpoint.eye, viewpoint.target, [0.0, 0.0, 1.0])
        projection = pybullet.computeProjectionMatrixFOV(viewpoint.field_of_view, width / height, viewpoint.near, 30.0)
        image = self._reader.getCameraImage(
            width,
            height,
            viewMatrix=view,
            projectionMatrix=projection,
            shadow=0,
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        )
        mask = np.asarray(image[4], dtype=np.int64).reshape(-1)
        bodies, links = mask & ((1 << 24) - 1), (mask >> 24) - 1
        of_hand = (bodies == built.robot) & np.isin(links, [built.links[link] for link in (*self._fingers, self._hand)])
        of_subjects = np.zeros(len(mask), bool)
        for name in subjects:
            if name in built.objects:
                of_subjects |= bodies == built.objects[name]
            elif name in built.articulations:
                body, link = built.articulations[name]
                of_subjects |= (bodies == body) & (links == link)
        visible = mask >= 0
        return float(np.mean(of_hand & visible)), float(np.mean(of_subjects & visible))

    def picture(self, viewpoint: Viewpoint, width: int, height: int, oversampling: int = 1) -> NDArray[np.uint8]:
        """(height, width, 3) uint8."""
        return smooth_picture(self._reader, viewpoint, width, height, oversampling)


def viewpoint(target: NDArray[np.float64], azimuth: float, elevation: float, distance: float) -> Viewpoint:
    """From ``distance`` metres, ``azimuth`` and ``elevation`` radians in the map frame."""
    away = np.array(
        [math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)]
    )
    eye = target + distance * away
    return Viewpoint(tuple(map(float, eye)), tuple(map(float, target)), 42.0)
