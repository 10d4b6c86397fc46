"""Images of the skills as events: all of them for subscribers, and in run folders the last one before a failure."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from behaviours.context import SkillContext
from bestman_bt.control.rgbd import RGBDView
from bestman_bt.messages import MotionObstacle
from bestman_bt.monitor.event_stream import Publish
from bestman_bt.records.events import ImageEvent, Topic
from bestman_bt.robot_model.model import ArmModel

FOLDER = "pictures"
SCENE = "scene"
"""Name of the picture of a failed motion, in place of a camera's name."""
MOST_PICTURES = 50
"""Largest number of pictures in a run folder."""
WIDEST_LIVE, WIDEST_KEPT, WIDEST_SCENE = 480, 320, 840
"""Largest width of a picture, pixels."""
QUALITY = 80


class PictureSource:
    """Listens to the robot's cameras without taking images itself. ``folder``: of the run, if any.

    For a failed motion it also renders the believed scene, with the obstacles in red.
    """

    def __init__(self, skills: SkillContext, folder: Path | None) -> None:
        self._skills, self._folder = skills, folder
        self._tell: Publish | None = None
        self._last: tuple[str, RGBDView] | None = None
        self._untold: dict[str, RGBDView] = {}
        self._kept: dict[tuple[str, float], str] = {}
        for camera in skills.cameras:
            camera.subscribe(partial(self._seen, camera.name))

    def begin(self, tell: Publish) -> None:
        """Start publishing to ``tell``."""
        self._tell = tell

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Publish the images of this tick."""
        if "images" in wanted and self._tell is not None:
            for camera, view in self._untold.items():
                self._tell(partial(_live_events, time, camera, view.image.rgb))
        self._untold.clear()

    def failed(self, time: float, node: str) -> None:
        """Save the latest image of any camera, and the scene of a failed motion."""
        if self._last is not None:
            camera, view = self._last
            self._keep(time, node, camera, view.stamp, lambda: view.image.rgb, WIDEST_KEPT)
        failure = next((one for one in reversed(self._skills.failures) if one.node == node), None)
        if failure is not None and failure.obstacle is not None and self._folder is not None:
            drawn = self._drawn(failure.obstacle)
            if drawn is not None:
                self._keep(time, node, SCENE, time, drawn, WIDEST_SCENE)

    def _keep(
        self, time: float, node: str, camera: str, stamp: float, rgb: Callable[[], NDArray[np.uint8]], widest: int
    ) -> None:
        if self._folder is None or self._tell is None:
            return
        file = self._kept.get((camera, stamp))
        if file is None:
            if len(self._kept) >= MOST_PICTURES:
                return
            file = self._kept[camera, stamp] = f"{FOLDER}/{len(self._kept) + 1:02}-{camera}.jpg"
        self._tell(partial(_kept_events, time, camera, rgb, self._folder, file, node, widest))

    def _drawn(self, obstacle: MotionObstacle) -> Callable[[], NDArray[np.uint8]] | None:
        """Draws the scene of the arm that failed, in the pose that was tried last, or None for a robot without an
        arm.
        """
        from bestman_bt.visualization.scene_picture import scene_picture

        arms = self._skills.robot.of(ArmModel).items()
        arm = next((name for name, model in arms if set(model.joint_names) <= set(obstacle.positions)), None)
        if arm is None:
            return None
        skills = self._skills.for_arm(arm)
        joints = skills.arm_model.joint_names
        at = np.array([obstacle.positions[name] for name in joints])
        scene = skills.planning_scene()
        bodies = skills.arm_world(scene).bodies(at)
        links = {name for name, _ in bodies} - {placed.name for placed in scene.obstacles}
        return partial(scene_picture, bodies, links, obstacle)

    def _seen(self, camera: str, view: RGBDView) -> None:
        self._last = (camera, view)
        self._untold[camera] = view


def _live_events(time: float, camera: str, rgb: NDArray[np.uint8]) -> tuple[ImageEvent]:
    width, height, jpeg = _jpeg(rgb, WIDEST_LIVE)
    return (ImageEvent(time, camera, width, height, jpeg=base64.b64encode(jpeg).decode()),)


def _kept_events(
    time: float, camera: str, rgb: Callable[[], NDArray[np.uint8]], folder: Path, file: str, node: str, widest: int
) -> tuple[ImageEvent]:
    width, height, jpeg = _jpeg(rgb(), widest)
    path = folder / file
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(jpeg)
    return (ImageEvent(time, camera, width, height, file=file, node=node),)


def _jpeg(rgb: NDArray[np.uint8], widest: int) -> tuple[int, int, bytes]:
    """Width, height and file of (H, W, 3) uint8, made smaller where it is wider than ``widest``."""
    image = Image.fromarray(rgb)
    image.thumbnail((widest, rgb.shape[0]))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return image.width, image.height, file.getvalue()
