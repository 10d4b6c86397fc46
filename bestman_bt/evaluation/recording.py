"""Recording a simulated run with Rerun: what the recorder is told, and when."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.control.rgbd import RGBDView
from bestman_bt.engine import StateChanges, Tree
from bestman_bt.evaluation.motion import robot_snapshot
from bestman_bt.evaluation.recorded_beliefs import RecordedBeliefs
from bestman_bt.messages import Cylinder, PlacedShape, Pose, Pose2D
from bestman_bt.records.described_tree import describe_changes, describe_tree
from bestman_bt.robot_model import ArmModel, CameraPart, GripperModel
from bestman_bt.runtime import Session
from bestman_bt.scene import Articulation, PlacedFurniture, Walker, World, wall_box
from bestman_bt.visualization import RecordedBody
from bestman_bt.visualization.rerun import RecordedCamera, RerunRecorder
from hal.simulation import SceneRecorder

WALL_COLOR = (0.85, 0.85, 0.82, 0.35)
WALKER_COLOR = (0.45, 0.5, 0.75, 1.0)


class Recording:
    """Feeds a recorder from a session: a snapshot every ``every``-th tick, images and clouds when a skill takes one."""

    def __init__(self, path: Path, session: Session, tree: Tree, scene: SceneRecorder, every: int = 2) -> None:
        setup = session.setup
        model = setup.robot_model
        self._session, self._tree, self._scene, self._every = session, tree, scene, every
        self._ticks = 0
        plotted = [joint for arm in model.of(ArmModel).values() for joint in arm.joint_names]
        self._recorder = RerunRecorder(
            path,
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
        """Take a last snapshot and close the file."""
        self._tree.unsubscribe(self._on_changes)
        self._snapshot()
        self._recorder.close()

    def after_tick(self) -> None:
        """Called by the executor."""
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
    """The places among what a task tells its tree: entry → (3,) metres, map frame.

    Only some goals are places: that of a plan is facts, as text.
    """
    points = {}
    for name, value in entries.items():
        if isinstance(value, Pose):
            points[name] = value.position
        elif isinstance(value, Pose2D):
            points[name] = np.array([*value.xy, 0.0])
    return points


def recorded_bodies(world: World) -> list[RecordedBody]:
    """Walls, furniture, objects and people of a world as the recorder draws them."""
    bodies = []
    for number, wall in enumerate(world.walls):
        box, pose = wall_box(wall)
        bodies.append(RecordedBody(f"wall{number}", (PlacedShape(box, Pose()),), (WALL_COLOR,), pose))
    for furniture in world.furniture:
        model = furniture.model
        bodies.append(RecordedBody(furniture.name, model.parts, model.colors, furniture.pose))
        bodies += [_leaf(furniture, articulation) for articulation in model.articulations]
    for thing in world.objects:
        shapes, colors = zip(*thing.model.appearance, strict=True)
        bodies.append(RecordedBody(thing.name, shapes, tuple((*color, 1.0) for color in colors), thing.pose))
    bodies += [_person(walker) for walker in world.walkers]
    return bodies


def _person(walker: Walker) -> RecordedBody:
    """In a frame on the floor, as hal.simulation.SceneSnapshot gives its pose."""
    shape = PlacedShape(Cylinder(walker.radius, walker.height), Pose(np.array([0.0, 0.0, walker.height / 2])))
    x, y = walker.route[0]
    return RecordedBody(walker.name, (shape,), (WALKER_COLOR,), Pose(np.array([x, y, 0.0])))


def _leaf(furniture: PlacedFurniture, articulation: Articulation) -> RecordedBody:
    """A door or drawer in a frame at its joint, as hal.simulation.SceneSnapshot gives its pose."""
    joint = Pose(np.array(articulation.origin))
    shapes = tuple(PlacedShape(part.shape, joint.inverse() @ part.pose) for part in articulation.parts)
    name = f"{furniture.name}/{articulation.name}"
    return RecordedBody(name, shapes, articulation.colors, furniture.pose @ joint)
