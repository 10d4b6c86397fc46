"""Pictures of a run for people: at the start, at the grasp, at the end."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bestman_bt.messages import Pose
from bestman_bt.records.keeping import RecordingErrors
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot

CLOSE = 1.5
"""Metres between robot and object up to which a picture closes in on both."""
ENOUGH = 0.003
"""Share of the picture at which the object is seen well enough."""


class Pictures:
    """Takes pictures into a run folder; construct it right after connecting, before time runs."""

    def __init__(self, robot: SimulatedRobot, truth: GroundTruth, folder: Path, keeping: RecordingErrors) -> None:
        self._photographer = ScenePhotographer(robot)
        self._truth = truth
        self._folder, self._keeping = folder, keeping
        self._walls = robot.world.walls

    def take(self, name: str, subject: str | None = None) -> Path:
        """Render ``<name>.png``: the robot and the object ``subject`` from the best viewpoint."""
        base = self._truth.base_pose()
        if subject is not None and subject in self._truth.object_names:
            thing = self._truth.object_pose(subject).position
            if np.linalg.norm((thing - base.position)[:2]) < CLOSE:
                return self._save(name, self._close_up(base, thing, subject))
        return self._save(name, self._overview())

    def _save(self, name: str, viewpoint: Viewpoint) -> Path:
        path = self._folder / f"{name}.png"
        picture = Image.fromarray(self._photographer.picture(viewpoint))
        self._keeping.write(path.name, lambda: picture.save(path))
        return path

    def _overview(self) -> Viewpoint:
        """Return all rooms, from above the longer side."""
        xs, ys = self._wall_ends()
        x, y = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
        width = max(max(xs) - min(xs), 4.0)
        return Viewpoint((x, min(ys) - 0.32 * width, 0.62 * width), (x, y - 0.2, 0.4), 52.0)

    def _close_up(self, base: Pose, thing: NDArray[np.float64], subject: str) -> Viewpoint:
        """Render robot and object from the direction in which the object is hidden least."""
        middle = (base.position + thing) / 2
        target = (float(middle[0]), float(middle[1]), float(thing[2]))
        best, most = None, -1.0
        for turn in np.arange(0.0, 2.0 * math.pi, math.pi / 6):
            direction = base.rotation[:2, :2] @ np.array([math.cos(turn), math.sin(turn)])
            for height in (0.55, 0.9):
                eye = (target[0] + 1.75 * direction[0], target[1] + 1.75 * direction[1], target[2] + height)
                viewpoint = Viewpoint((float(eye[0]), float(eye[1]), float(eye[2])), target)
                of_thing, of_robot = self._photographer.visible(viewpoint, subject)
                score = min(of_thing, ENOUGH) / ENOUGH + 0.5 * min(of_robot, 0.2) / 0.2
                if not self._inside_the_rooms(eye[0], eye[1]):
                    score -= 0.4
                if score > most:
                    best, most = viewpoint, score
        assert best is not None
        return best

    def _inside_the_rooms(self, x: float, y: float) -> bool:
        xs, ys = self._wall_ends()
        return min(xs) < x < max(xs) and min(ys) < y < max(ys)

    def _wall_ends(self) -> tuple[list[float], list[float]]:
        ends = [end for wall in self._walls for end in (wall.start, wall.end)] or [(-2.0, -2.0), (2.0, 2.0)]
        return [x for x, _ in ends], [y for _, y in ends]
