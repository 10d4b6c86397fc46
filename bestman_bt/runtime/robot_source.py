"""The robot's state and images as events: base pose, joints, held objects, lidar scan, path, pictures."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from behaviours.context import SkillContext
from bestman_bt.control.joint_state import READING_ERRORS, JointStateSensor
from bestman_bt.control.operator_speed import OperatorSpeed
from bestman_bt.control.rgbd import RGBDView
from bestman_bt.control.wheeled.localisation_cycle import PlacedScan
from bestman_bt.messages import MotionObstacle, Path2D, Pose2D
from bestman_bt.monitor.event_stream import Publish
from bestman_bt.records.events import ImageEvent, MapEvent, MapPiece, PathEvent, RobotEvent, ScanEvent, Topic
from bestman_bt.robot_model.model import ArmModel, RobotModel
from bestman_bt.world_model.semantic_map import SemanticMap
from bestman_bt.world_model.world_model import BasePose
from hal.api import Robot

ROBOT_EVERY, SCAN_EVERY = 0.1, 0.5
"""Seconds of the clock between events."""
EARLY = 1e-3
"""Seconds that a tick may come early and still count as due."""
MOST_POINTS = 180
"""Largest number of points of a scan or path in an event."""
DECIMALS = 4
"""Decimals of metres and radians."""

Points = list[tuple[float, float]]


class RobotSource:
    """Reads the encoders separately from the skills, so that recordings are not affected; scans are those of
    localisation.
    """

    def __init__(self, robot: Robot, model: RobotModel, skills: SkillContext, speed: OperatorSpeed) -> None:
        self._skills, self._speed = skills, speed
        self._joints = JointStateSensor(robot.parts, model)
        self._publish: Publish | None = None
        self._next_robot = self._next_scan = 0.0
        self._path: Path2D | None = None

    def begin(self, publish: Publish) -> None:
        """Publish the map."""
        self._publish = publish
        publish(partial(_map_events, self._skills.world.map))

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Publish the events that are due."""
        publish = self._publish
        if publish is None:
            return
        if time >= self._next_robot - EARLY:
            self._next_robot = time + ROBOT_EVERY
            publish(self._robot_now(time, tick))
        if not self._skills.has("base") or not self._skills.has("lidar"):
            return
        base = self._skills.base
        if base.path is not self._path:
            self._path = base.path
            publish(partial(_path_events, time, self._path))
        if base.last_scan is not None and time >= self._next_scan - EARLY:
            self._next_scan = time + SCAN_EVERY
            publish(partial(_scan_events, time, base.last_scan, base.lidar.base_from_lidar))

    def failed(self, time: float, node: str) -> None:
        """Do nothing: all states are published anyway."""

    def _robot_now(self, time: float, tick: int) -> partial[tuple[RobotEvent]]:
        joints, diagnostics = {}, None
        try:
            joints = dict(self._joints.positions())
        except READING_ERRORS as error:
            diagnostics = {"encoders": str(error)}
        world = self._skills.world
        held = ", ".join(one.name for one in world.hands.values()) or None
        return partial(_robot_events, time, tick, world.base, joints, held, diagnostics, self._speed.share)


def _robot_events(
    time: float,
    tick: int,
    base: BasePose,
    joints: dict[str, float],
    held: str | None,
    diagnostics: dict[str, str] | None,
    speed: float,
) -> tuple[RobotEvent]:
    rounded = {name: round(float(position), DECIMALS) for name, position in joints.items() if math.isfinite(position)}
    std = (round(base.position_std, DECIMALS), round(base.heading_std, DECIMALS))
    return (RobotEvent(time, tick, _planar(base.pose), std, rounded, held=held, diagnostics=diagnostics, speed=speed),)


def _path_events(time: float, path: Path2D | None) -> tuple[PathEvent]:
    return (PathEvent(time, [] if path is None else _thinned(path.points)),)


def _scan_events(time: float, seen: PlacedScan, base_from_lidar: Pose2D) -> tuple[ScanEvent]:
    points = seen.map_from_lidar.apply(seen.scan.points())
    return (ScanEvent(time, _planar(seen.map_from_lidar @ base_from_lidar.inverse()), _thinned(points)),)


def _map_events(plan: SemanticMap) -> tuple[MapEvent]:
    x_min, y_min, x_max, y_max = plan.bounds()
    furniture = [MapPiece(piece.name, _points(piece.corners())) for piece in plan.furniture.values()]
    walls = [(x1, y1, x2, y2) for x1, y1, x2, y2 in np.round(plan.walls, DECIMALS).tolist()]
    return (MapEvent(1.0, (x_min, y_min), round(x_max - x_min), round(y_max - y_min), "", furniture, walls),)


def _planar(pose: Pose2D) -> tuple[float, float, float]:
    return round(pose.x, DECIMALS), round(pose.y, DECIMALS), round(pose.theta, DECIMALS)


def _thinned(points: NDArray[np.float64]) -> Points:
    """Return at most ``MOST_POINTS`` of (N, 2) points, evenly, with the last one."""
    if len(points) > MOST_POINTS:
        points = points[np.linspace(0, len(points) - 1, MOST_POINTS).astype(int)]
    return _points(points)


def _points(points: NDArray[np.float64]) -> Points:
    return [(x, y) for x, y in np.round(points, 2).tolist()]


FOLDER = "pictures"
SCENE = "scene"
"""Name of the picture of a failed motion, used instead of a camera's name."""
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
        self._publish: Publish | None = None
        self._last: tuple[str, RGBDView] | None = None
        self._untold: dict[str, RGBDView] = {}
        self._kept: dict[tuple[str, float], str] = {}
        for camera in skills.cameras:
            camera.subscribe(partial(self._seen, camera.name))

    def begin(self, publish: Publish) -> None:
        """Start publishing to ``publish``."""
        self._publish = publish

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Publish the images of this tick."""
        if "images" in wanted and self._publish is not None:
            for camera, view in self._untold.items():
                self._publish(partial(_live_events, time, camera, view.image.rgb))
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
        if self._folder is None or self._publish is None:
            return
        file = self._kept.get((camera, stamp))
        if file is None:
            if len(self._kept) >= MOST_PICTURES:
                return
            file = self._kept[camera, stamp] = f"{FOLDER}/{len(self._kept) + 1:02}-{camera}.jpg"
        self._publish(partial(_kept_events, time, camera, rgb, self._folder, file, node, widest))

    def _drawn(self, obstacle: MotionObstacle) -> Callable[[], NDArray[np.uint8]] | None:
        """Return the scene of the arm that failed, in the pose that was tried last, or None for a
        robot without an arm.
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
    """Return width, height and JPEG file of (H, W, 3) uint8, scaled down if wider than ``widest``."""
    image = Image.fromarray(rgb)
    image.thumbnail((widest, rgb.shape[0]))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return image.width, image.height, file.getvalue()
