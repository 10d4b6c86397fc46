"""The robot's state as events: believed base pose, joints, held objects, lidar scan, path."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import NDArray

from behaviours.context import SkillContext
from bestman_bt.control.joint_state import JointStateError, JointStateSensor
from bestman_bt.control.operator_speed import OperatorSpeed
from bestman_bt.control.wheeled.localisation_cycle import PlacedScan
from bestman_bt.messages import Path2D, Pose2D
from bestman_bt.monitor.event_stream import Publish
from bestman_bt.records.events import MapEvent, MapPiece, PathEvent, RobotEvent, ScanEvent, Topic
from bestman_bt.robot_model.model import RobotModel
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
        self._tell: Publish | None = None
        self._next_robot = self._next_scan = 0.0
        self._path: Path2D | None = None

    def begin(self, tell: Publish) -> None:
        """Publish the map."""
        self._tell = tell
        tell(partial(_map_events, self._skills.world.map))

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Publish the events that are due."""
        tell = self._tell
        if tell is None:
            return
        if time >= self._next_robot - EARLY:
            self._next_robot = time + ROBOT_EVERY
            tell(self._robot_now(time, tick))
        if not self._skills.has("base") or not self._skills.has("lidar"):
            return
        base = self._skills.base
        if base.path is not self._path:
            self._path = base.path
            tell(partial(_path_events, time, self._path))
        if base.last_scan is not None and time >= self._next_scan - EARLY:
            self._next_scan = time + SCAN_EVERY
            tell(partial(_scan_events, time, base.last_scan, base.lidar.base_from_lidar))

    def failed(self, time: float, node: str) -> None:
        """Do nothing: all states are published anyway."""

    def _robot_now(self, time: float, tick: int) -> partial[tuple[RobotEvent]]:
        joints, diagnostics = {}, None
        try:
            joints = dict(self._joints.positions())
        except JointStateError as error:
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
    """At most ``MOST_POINTS`` of (N, 2) points, evenly, with the last one."""
    if len(points) > MOST_POINTS:
        points = points[np.linspace(0, len(points) - 1, MOST_POINTS).astype(int)]
    return _points(points)


def _points(points: NDArray[np.float64]) -> Points:
    return [(x, y) for x, y in np.round(points, 2).tolist()]
