"""What a recording is told of the robot's own view: its map, path, lidar, objects, grasps, and the blackboard."""

from __future__ import annotations

import numpy as np

from behaviours.grasp import PlannedGrasp
from bestman_bt.control.wheeled import BaseController
from bestman_bt.control.wheeled.localisation_cycle import PlacedScan
from bestman_bt.engine import Tree
from bestman_bt.manipulation.kinematics import ForwardKinematics
from bestman_bt.messages import Path2D, Pose, Pose2D
from bestman_bt.records.shown_value import show_value
from bestman_bt.robot_model import LidarPart
from bestman_bt.runtime import Session
from bestman_bt.runtime.blackboard_changes import BlackboardChanges, WrittenEntry
from bestman_bt.runtime.looking import object_marks
from bestman_bt.visualization.marks import GraspMark
from bestman_bt.visualization.rerun import RerunRecorder
from bestman_bt.world_model import ObjectBelief

SCAN_EVERY = 0.5
"""Seconds between scans."""
LONGEST_TEXT = 300
"""Characters of a blackboard entry."""


class RecordedBeliefs:
    """Tells ``recorder``, after each tick, what has changed of what the robot believes; reads only what is there."""

    def __init__(self, recorder: RerunRecorder, session: Session, tree: Tree) -> None:
        self._recorder = recorder
        self._session = session
        self._blackboard = BlackboardChanges(tree)
        self._path: Path2D | None = None
        self._scan: PlacedScan | None = None
        self._next_scan = 0.0
        self._grasps: tuple[str, str] | None = None
        self._objects: dict[str, ObjectBelief] = {}
        model = session.setup.robot_model
        frames = [lidar.frame for lidar in model.of(LidarPart).values()]
        self._lidar_height = float(ForwardKinematics(model).pose(frames[0], {}).position[2]) if frames else 0.0

    def begin(self) -> None:
        """Tell the map, and how all stands."""
        known = self._session.skills.world.map
        self._recorder.map(known.walls, {name: piece.corners() for name, piece in known.furniture.items()})
        self.after_tick()

    def after_tick(self) -> None:
        """Tell what is new."""
        skills, stamp = self._session.skills, self._session.robot.clock.now()
        if skills.has("base") and skills.has("lidar"):
            self._tell_driving(skills.base, stamp)
        if skills.world.objects != self._objects:
            self._objects = dict(skills.world.objects)
            self._recorder.objects(object_marks(skills), stamp)
        for entry in self._blackboard.collect():
            self._recorder.blackboard(_line(entry), stamp)
            self._tell_grasps(entry, stamp)

    def _tell_driving(self, base: BaseController, stamp: float) -> None:
        """The path that is new, and a scan where one is due."""
        if base.path is not self._path:
            self._path = base.path
            self._recorder.path("planned", self._path, stamp)
        scan = base.last_scan
        if scan is not None and scan is not self._scan and stamp >= self._next_scan:
            self._scan, self._next_scan = scan, stamp + SCAN_EVERY
            self._recorder.scan("lidar", scan.scan, self._at_lidar_height(scan.map_from_lidar))

    def _at_lidar_height(self, map_from_lidar: Pose2D) -> Pose:
        return Pose(np.array([*map_from_lidar.xy, self._lidar_height]), map_from_lidar.to_pose().quaternion)

    def _tell_grasps(self, entry: WrittenEntry, stamp: float) -> None:
        """Grasps that are left, where the entry has or had some."""
        planned = entry.value if entry.exists and isinstance(entry.value, list) else []
        where = (entry.scope, entry.key)
        if planned and all(isinstance(one, PlannedGrasp) for one in planned):
            self._grasps = where
        elif where == self._grasps:
            self._grasps, planned = None, []
        else:
            return
        depth = self._session.skills.gripper_model.part.finger_depth
        self._recorder.grasps([_mark(grasp, depth) for grasp in planned], stamp)


def _mark(planned: PlannedGrasp, finger_depth: float) -> GraspMark:
    pose = planned.map_from_object @ planned.tool_from_object.inverse()
    return GraspMark("grasp", pose, planned.candidate.width, finger_depth, planned.candidate.quality)


def _line(entry: WrittenEntry) -> str:
    name = f"{entry.scope}/{entry.key}" if entry.scope else entry.key
    if not entry.exists:
        return f"{name} is gone"
    text = show_value(entry.value, entry.kind).text
    return f"{name} = {text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + '…'}"
