"""Pictures of a run for people: at the start, at the grasp, at the end."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from PIL import Image

from bestman_bt.messages import Pose
from hal.pybullet import GroundTruth, PyBulletRobot, ScenePhotographer, Viewpoint


class Pictures:
    """Takes pictures into a run folder; made right after connecting, before time runs."""

    def __init__(self, robot: PyBulletRobot, truth: GroundTruth, folder: Path) -> None:
        self._photographer = ScenePhotographer(robot)
        self._truth = truth
        self._folder = folder
        self._walls = robot.world.walls

    def take(self, name: str, subject: str | None = None) -> Path:
        """Render ``<name>.png``: the robot and the object ``subject`` from the side that shows both."""
        base = self._truth.base_pose()
        target = base.position + np.array([0.0, 0.0, 0.7])
        if subject is not None and subject in self._truth.object_names:
            thing = self._truth.object_pose(subject).position
            if np.linalg.norm((thing - target)[:2]) < 1.5:
                target = (thing + target) / 2
        path = self._folder / f"{name}.png"
        Image.fromarray(self._photographer.picture(Viewpoint(self._eye(base, target), tuple(map(float, target))))).save(
            path
        )
        return path

    def _eye(self, base: Pose, target: np.ndarray) -> tuple[float, float, float]:
        """Beside and a little behind the robot, on the side with more room."""
        xs = [x for wall in self._walls for x in (wall.start[0], wall.end[0])]
        ys = [y for wall in self._walls for y in (wall.start[1], wall.end[1])]
        middle = np.array([(min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2])
        best, room = (0.0, 0.0, 0.0), -math.inf
        for side in (-1.0, 1.0):
            direction = base.rotation[:2, :2] @ np.array([-0.45, side])
            eye = target[:2] + 2.3 * direction / np.linalg.norm(direction)
            closeness = -float(np.linalg.norm(eye - middle))
            if closeness > room:
                best, room = (float(eye[0]), float(eye[1]), 2.0), closeness
        return best
