"""Recordings of a simulated run: with Rerun, and pictures at the start, at the grasp and at the end."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from behaviours.manipulation.grasp import PlannedGrasp
from bestman_bt.control.rgbd import RGBDView
from bestman_bt.control.wheeled.base_controller import BaseController
from bestman_bt.control.wheeled.localisation_cycle import PlacedScan
from bestman_bt.engine import StateChanges, Tree
from bestman_bt.evaluation.episode_measures import robot_snapshot
from bestman_bt.manipulation.kinematics.link_hulls import ForwardKinematics
from bestman_bt.messages import Cylinder, Path2D, PlacedShape, Pose, Pose2D
from bestman_bt.records.described_tree import describe_changes, describe_tree
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.records.shown_value import show_value
from bestman_bt.robot_model.model import ArmModel, GripperModel
from bestman_bt.robot_model.sensor_parts import CameraPart, LidarPart
from bestman_bt.runtime.perception_preview import object_marks
from bestman_bt.runtime.robot_session import RobotSession
from bestman_bt.runtime.telemetry import BlackboardChanges, WrittenEntry
from bestman_bt.scene.scene import Articulation, PlacedFurniture, Walker, World, wall_box
from bestman_bt.visualization.marks import GraspMark
from bestman_bt.visualization.rerun.open_recording import RecordedCamera, RecordingSetup
from bestman_bt.visualization.rerun.recorder import RECORDING_NAME, RerunRecorder
from bestman_bt.visualization.snapshot import RecordedBody
from bestman_bt.world_model.world_model import ObjectBelief
from hal.simulation.bodies import Viewpoint
from hal.simulation.camera import ScenePhotographer
from hal.simulation.ground_truth import GroundTruth
from hal.simulation.robot import SimulatedRobot
from hal.simulation.scene_recorder import SceneRecorder

SCAN_EVERY = 0.5
"""Seconds between scans."""
LONGEST_TEXT = 300
"""Characters of a blackboard entry."""


class RecordedBeliefs:
    """Passes changes of the beliefs to ``recorder`` after each tick; it only reads existing beliefs."""

    def __init__(self, recorder: RerunRecorder, session: RobotSession, tree: Tree) -> None:
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
        """Record the map and the initial state."""
        known = self._session.skills.world.map
        self._recorder.map(known.walls, {name: piece.corners() for name, piece in known.furniture.items()})
        self.after_tick()

    def after_tick(self) -> None:
        """Record the changed beliefs."""
        skills, stamp = self._session.skills, self._session.robot.clock.now()
        if skills.has("base") and skills.has("lidar"):
            self._record_driving(skills.base, stamp)
        if skills.world.objects != self._objects:
            self._objects = dict(skills.world.objects)
            self._recorder.objects(object_marks(skills), stamp)
        for entry in self._blackboard.collect():
            self._recorder.blackboard(_line(entry), stamp)
            self._record_grasps(entry, stamp)

    def _record_driving(self, base: BaseController, stamp: float) -> None:
        """Record a new path, and a scan if one is due."""
        if base.path is not self._path:
            self._path = base.path
            self._recorder.path("planned", self._path, stamp)
        scan = base.last_scan
        if scan is not None and scan is not self._scan and stamp >= self._next_scan:
            self._scan, self._next_scan = scan, stamp + SCAN_EVERY
            position = np.array([*scan.map_from_lidar.xy, self._lidar_height])
            self._recorder.scan("lidar", scan.scan, Pose(position, scan.map_from_lidar.to_pose().quaternion))

    def _record_grasps(self, entry: WrittenEntry, stamp: float) -> None:
        """Record the remaining grasps, if the entry has or had some."""
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


WALL_COLOR = (0.85, 0.85, 0.82, 0.35)
WALKER_COLOR = (0.45, 0.5, 0.75, 1.0)


class Recording:
    """Feeds a recorder from a session: a snapshot every ``every``-th tick, images and clouds when a skill takes one."""

    def __init__(
        self,
        path: Path,
        session: RobotSession,
        tree: Tree,
        scene: SceneRecorder,
        every: int = 2,
        keeping: RecordingErrors | None = None,
    ) -> None:
        self._keeping = keeping or RecordingErrors()
        setup = session.setup
        model = setup.robot_model
        self._session, self._tree, self._scene, self._every = session, tree, scene, every
        self._ticks = 0
        plotted = [joint for arm in model.of(ArmModel).values() for joint in arm.joint_names]
        self._recorder = RerunRecorder(
            path,
            RecordingSetup(
                urdf=model.urdf,
                base_frame=model.base_frame,
                tree=describe_tree(tree),
                bodies=recorded_bodies(setup.world),
                cameras={
                    name: RecordedCamera(camera.intrinsics, camera.optical_frame)
                    for name, camera in model.of(CameraPart).items()
                },
                plotted_joints=plotted,
                grippers={name: gripper.part.joints for name, gripper in model.of(GripperModel).items()},
            ),
        )
        self._beliefs = RecordedBeliefs(self._recorder, session, tree)

    def open(self) -> None:
        """Start recording."""
        self._recorder.open()
        self._tree.subscribe(self._on_changes)
        for sensor in self._session.skills.cameras:
            sensor.subscribe(partial(self._on_view, sensor.name))
        self._snapshot()
        self._beliefs.begin()
        for name, point in goal_points(self._session.entries).items():
            self._recorder.goal(point, self._session.robot.clock.now(), name)

    def close(self) -> None:
        """Record a last snapshot and close the file."""
        self._tree.unsubscribe(self._on_changes)
        self._snapshot()
        self._keeping.write(RECORDING_NAME, self._recorder.close)

    def after_tick(self) -> None:
        """Count a tick and record a snapshot at the configured interval; called by the executor."""
        self._ticks += 1
        if self._ticks % self._every == 0:
            self._snapshot()
        self._beliefs.after_tick()

    def _snapshot(self) -> None:
        seen = self._scene.scene_snapshot()
        self._recorder.snapshot(robot_snapshot(seen, self._ticks, self._session.skills.map_from_base))

    def _on_changes(self, changes: StateChanges) -> None:
        self._recorder.changes(describe_changes(self._tree, changes, 0.0, self._ticks))

    def _on_view(self, camera: str, view: RGBDView) -> None:
        self._recorder.image(camera, view.image)
        self._recorder.cloud(f"{camera}_cloud", view.in_map.cloud(), view.stamp)


def goal_points(entries: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
    """Return the goal positions among a task's entries: entry → (3,) metres, map frame.

    Goals that are facts have no position.
    """
    points = {}
    for name, value in entries.items():
        if isinstance(value, Pose):
            points[name] = value.position
        elif isinstance(value, Pose2D):
            points[name] = np.array([*value.xy, 0.0])
    return points


def recorded_bodies(world: World) -> list[RecordedBody]:
    """Return walls, furniture, objects and people of a world for the recorder."""
    bodies = []
    for number, wall in enumerate(world.walls):
        box, pose = wall_box(wall)
        bodies.append(RecordedBody(f"wall{number}", (PlacedShape(box, Pose()),), (WALL_COLOR,), pose))
    for furniture in world.furniture:
        model = furniture.model
        bodies.append(RecordedBody(furniture.name, model.parts, model.colors, furniture.pose))
        bodies += [_door(furniture, articulation) for articulation in model.articulations]
    for thing in world.objects:
        shapes, colors = zip(*thing.model.appearance, strict=True)
        bodies.append(RecordedBody(thing.name, shapes, tuple((*color, 1.0) for color in colors), thing.pose))
    bodies += [_person(walker) for walker in world.walkers]
    return bodies


def _person(walker: Walker) -> RecordedBody:
    """Return the outline of a person in the floor frame of hal.simulation.scene_recorder.SceneSnapshot."""
    shape = PlacedShape(Cylinder(walker.radius, walker.height), Pose(np.array([0.0, 0.0, walker.height / 2])))
    x, y = walker.route[0]
    return RecordedBody(walker.name, (shape,), (WALKER_COLOR,), Pose(np.array([x, y, 0.0])))


def _door(furniture: PlacedFurniture, articulation: Articulation) -> RecordedBody:
    """Return a door or drawer in a frame at its joint, the frame of ``hal.simulation.scene_recorder.SceneSnapshot``."""
    joint = Pose(np.array(articulation.origin))
    shapes = tuple(PlacedShape(part.shape, joint.inverse() @ part.pose) for part in articulation.parts)
    name = f"{furniture.name}/{articulation.name}"
    return RecordedBody(name, shapes, articulation.colors, furniture.pose @ joint)


CLOSE = 1.5
"""Distance between robot and object up to which a picture shows both in close-up, metres."""
ENOUGH = 0.003
"""Fraction of the picture from which the object is sufficiently visible."""


class Pictures:
    """Takes pictures into a run folder; construct it right after connecting, before the first step."""

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
