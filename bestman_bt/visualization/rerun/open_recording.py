"""The open recording: constants are written immediately, everything else as it happens.

Its layout: scene and camera on the left, tree and its log on the right.
"""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import CameraIntrinsics, Pose
from bestman_bt.records.events import TreeEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.nodes import NodeList
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.rerun import bodies, entities, sensed
from bestman_bt.visualization.rerun.bodies import FrameTransforms, body_frame, bounds, write_body, write_floor
from bestman_bt.visualization.rerun.sensed import SensorRecording
from bestman_bt.visualization.rerun.tree_graph import StateLanes, TreeGraph, lane_entities
from bestman_bt.visualization.snapshot import RecordedBody

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.urdf import UrdfJoint, UrdfTree

CURVE_COLORS = (
    (78, 161, 255),
    (255, 160, 60),
    (90, 200, 110),
    (240, 90, 90),
    (175, 130, 255),
    (230, 205, 70),
    (80, 205, 200),
    (245, 135, 195),
)


class TimeSeries:
    """The curves ``names`` of the plot ``entity``."""

    def __init__(self, recording: rr.RecordingStream, entity: str, names: Sequence[str]) -> None:
        self._recording = recording
        self._entity = entity
        self._names = tuple(names)

    def write_styles(self) -> None:
        """Write names and colours of the curves."""
        import rerun as rr

        if self._names:
            colors = [CURVE_COLORS[i % len(CURVE_COLORS)] for i in range(len(self._names))]
            self._recording.log(
                self._entity, rr.SeriesLines(names=short_names(self._names), colors=colors, widths=1.5), static=True
            )

    def write(self, values: Sequence[float]) -> None:
        """Write one value per curve, at the time that is set on the recording."""
        import rerun as rr

        if self._names:
            self._recording.log(self._entity, rr.Scalars(values))


def short_names(names: Sequence[str]) -> list[str]:
    """Return the names without their common prefix, up to an underscore: ``panda_joint1`` becomes ``joint1``."""
    shared = 0
    if len(names) > 1:
        first, last = min(names), max(names)
        while shared < len(first) and first[shared] == last[shared]:
            shared += 1
    start = names[0][:shared].rfind("_") + 1 if names else 0
    return [name[start:] for name in names]


MOVABLE_JOINTS = frozenset({"revolute", "continuous", "prismatic"})


@dataclass(frozen=True, eq=False)
class _Joint:
    parent: str
    child: str
    prismatic: bool
    axis: NDArray[np.float64]
    origin: Pose

    def transform(self, value: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        if self.prismatic:
            return self.origin.position + self.origin.rotation @ (self.axis * value), self.origin.quaternion
        x1, y1, z1, w1 = self.origin.quaternion
        x2, y2, z2 = self.axis * np.sin(value / 2)
        w2 = np.cos(value / 2)
        quaternion = np.array(
            [
                w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
                w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
                w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
                w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            ]
        )
        return self.origin.position, quaternion


class RobotEntities:
    """A URDF robot: ``urdf`` is its text with absolute mesh paths, ``base_frame`` the link whose pose is given."""

    def __init__(self, urdf: str, base_frame: str) -> None:
        self.base_frame = base_frame
        self._urdf = urdf
        self._joints: dict[str, _Joint] = {}
        self._base_from_root = Pose()
        self._root = base_frame
        self.name = ""

    def write_model(self, recording: rr.RecordingStream) -> None:
        """Write the visual meshes and the fixed joints. Raises RecordingError if the URDF or a mesh cannot be read."""
        from rerun.urdf import UrdfTree

        text = _without_collision(self._urdf)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "robot.urdf"
            path.write_bytes(text)
            try:
                tree = UrdfTree.from_file_path(
                    path,
                    entity_path_prefix=entities.WORLD,
                    frame_prefix=entities.ROBOT_FRAME_PREFIX,
                    static_transform_entity_path=entities.STATIC_TRANSFORMS,
                )
                tree.log_urdf_to_recording(recording)
                _fill_primitives(recording, tree, text)
            except (RuntimeError, ValueError, OSError) as error:
                raise RecordingError(f"robot URDF: {error}") from error
        self.name = tree.name
        self._root = tree.root_link().name
        joints = tree.joints()
        self._base_from_root = self._pose_of_root(joints)
        for joint in joints:
            if joint.joint_type in MOVABLE_JOINTS:
                axis = np.asarray(joint.axis, dtype=float)
                self._joints[joint.name] = _Joint(
                    joint.parent_link,
                    joint.child_link,
                    joint.joint_type == "prismatic",
                    axis / np.linalg.norm(axis),
                    Pose.from_xyz_rpy(joint.origin_xyz, joint.origin_rpy),
                )

    def place(self, transforms: FrameTransforms, map_from_base: Pose, joint_positions: Mapping[str, float]) -> None:
        """Add the frames of the base and of the joints.

        Raises RecordingError for a joint that the URDF does not have.
        """
        transforms.add_pose(
            entities.MAP_FRAME, entities.ROBOT_FRAME_PREFIX + self._root, map_from_base @ self._base_from_root
        )
        for name, position in joint_positions.items():
            if name not in self._joints:
                raise RecordingError(
                    f"snapshot: joint {name!r} is not a movable joint of robot {self.name!r}; "
                    f"it has {', '.join(self._joints) or 'none'}"
                )
            joint = self._joints[name]
            translation, quaternion = joint.transform(position)
            prefix = entities.ROBOT_FRAME_PREFIX
            transforms.add(prefix + joint.parent, prefix + joint.child, translation, quaternion)

    def _pose_of_root(self, joints: Sequence[UrdfJoint]) -> Pose:
        """Return base_from_root, if fixed joints connect the base frame with the root."""
        by_child = {joint.child_link: joint for joint in joints}
        root_from_base, link = Pose(), self.base_frame
        while link != self._root:
            joint = by_child.get(link)
            if joint is None or joint.joint_type != "fixed":
                raise RecordingError(
                    f"base_frame {self.base_frame!r} should be the root link {self._root!r} of the robot "
                    f"or be fixed to it"
                )
            root_from_base = Pose.from_xyz_rpy(joint.origin_xyz, joint.origin_rpy) @ root_from_base
            link = joint.parent_link
        return root_from_base.inverse()


def _fill_primitives(recording: rr.RecordingStream, tree: UrdfTree, urdf: bytes) -> None:
    """Draw boxes, cylinders and balls solid: by default Rerun draws them transparent."""
    import rerun as rr

    archetypes: dict[str, Any] = {"box": rr.Boxes3D, "cylinder": rr.Cylinders3D, "sphere": rr.Ellipsoids3D}
    for link in ElementTree.fromstring(urdf).iter("link"):
        shapes = [shape.tag for shape in link.findall("visual/geometry/*")]
        for path, shape in zip(tree.get_visual_geometry_paths(link.get("name", "")), shapes, strict=True):
            if shape in archetypes:
                solid = archetypes[shape].from_fields(fill_mode=rr.components.FillMode.Solid)
                recording.log(path, solid, static=True)


def _without_collision(urdf: str) -> bytes:
    """Return the same robot without collision shapes: they would double the recording and hide the visual ones."""
    try:
        root = ElementTree.fromstring(urdf)
    except ElementTree.ParseError as error:
        raise RecordingError(f"robot URDF: {error}") from error
    for link in root.iter("link"):
        for collision in link.findall("collision"):
            link.remove(collision)
    for mesh in root.iter("mesh"):
        path = Path(mesh.get("filename", "").removeprefix("file://"))
        if not path.is_absolute() or not path.is_file():
            raise RecordingError(f"robot URDF: mesh {mesh.get('filename')!r} should be the absolute path of a file")
    return ElementTree.tostring(root)


@dataclass(frozen=True)
class RecordedCamera:
    """A camera of the robot: its pinhole model and the link of its optical frame."""

    intrinsics: CameraIntrinsics
    optical_frame: str


@dataclass(frozen=True, eq=False)
class RecordingSetup:
    """The configuration of a recording.

    ``urdf``: the robot's URDF text, meshes by absolute path. ``base_frame``: the link whose pose snapshots give.
    ``tree``: the main tree. ``plotted_joints``: plotted over time, radians or metres. ``grippers``: gripper name →
    finger joints, whose sum is the opening width. ``eye``: the viewpoint; None: one that shows all bodies.
    """

    urdf: str
    base_frame: str
    tree: TreeEvent
    bodies: Sequence[RecordedBody] = ()
    cameras: Mapping[str, RecordedCamera] = field(default_factory=dict)
    plotted_joints: Sequence[str] = ()
    grippers: Mapping[str, Sequence[str]] = field(default_factory=dict)
    eye: Eye | None = None
    sensors: SensorRecording = field(default_factory=SensorRecording)

    def blueprint(self) -> rrb.Blueprint:
        """Return the layout of the opened recording."""
        plots = [entities.JOINTS] * bool(self.plotted_joints) + [entities.GRIPPERS] * bool(self.grippers)
        eye = self.eye or eye_on(bounds(self.bodies))
        return build_blueprint(_history(self.tree).nodes, eye, list(self.cameras), plots)


class OpenRecording:
    """The parts that write to ``stream``, and the current time."""

    def __init__(self, stream: rr.RecordingStream, setup: RecordingSetup) -> None:
        self.stream = stream
        self.robot = RobotEntities(setup.urdf, setup.base_frame)
        self.transforms = FrameTransforms(stream)
        self.history = _history(setup.tree)
        self.graph = TreeGraph(stream, self.history.nodes)
        self.lanes = StateLanes(stream, self.history.nodes)
        self.joints = TimeSeries(stream, entities.JOINTS, tuple(setup.plotted_joints))
        self.widths = TimeSeries(stream, entities.GRIPPERS, tuple(f"{name} width" for name in setup.grippers))
        self.driven = bodies.BaseTrail()
        self.has_belief = False
        self.objects: dict[str, str] = {}
        """Entities of the believed objects."""
        self._tick = 0
        self._setup = setup

    def write_constants(self) -> None:
        """Write everything that does not change. Raises RecordingError for a robot that cannot be shown."""
        import rerun as rr

        stream, setup = self.stream, self._setup
        stream.log(
            entities.WORLD,
            rr.ViewCoordinates.RIGHT_HAND_Z_UP,
            rr.Transform3D(translation=(0.0, 0.0, 0.0), parent_frame=entities.MAP_FRAME),
            static=True,
        )
        self.robot.write_model(stream)
        for name, camera in setup.cameras.items():
            sensed.write_camera(stream, name, camera.optical_frame, camera.intrinsics, setup.sensors.frustum_length)
        write_floor(stream, bounds(setup.bodies))
        for body in setup.bodies:
            write_body(stream, body)
        self.graph.write_shape()
        self.lanes.write_styles()
        self.joints.write_styles()
        self.widths.write_styles()
        self.set_time(0.0)
        self.graph.write_colors(self.history.states.now)
        for body in setup.bodies:
            self.transforms.add_pose(entities.MAP_FRAME, body_frame(body.name), body.pose)
        self.transforms.write(0.0, 0)

    def set_time(self, stamp: float, tick: int | None = None) -> None:
        """Set the time of the next rows; ``tick`` None keeps the current one."""
        if tick is not None:
            self._tick = tick
        self.stream.set_time(entities.SIM_TIME, duration=stamp)
        self.stream.set_time(entities.TICK, sequence=self._tick)

    def write_line(self, level: str, message: str, entity: str = entities.LOG) -> None:
        """Write a line of the log."""
        import rerun as rr

        self.stream.log(entity, rr.TextLog(message, level=level))


def _history(tree: TreeEvent) -> RunHistory:
    history = RunHistory()
    history.take(tree)
    return history


BACKGROUND = (28, 31, 38)
GRAPH_MARGIN = 20.0


@dataclass(frozen=True)
class Eye:
    """The viewpoint of the scene in the map frame, metres."""

    position: tuple[float, float, float]
    look_at: tuple[float, float, float]


def eye_on(bounds: NDArray[np.float64], azimuth: float = -2.2, elevation: float = 0.8) -> Eye:
    """Return a view from outside and above of the middle of a (2, 3) bounding box, metres; angles from the middle to
    the eye, radians.
    """
    centre, extent = bounds.mean(axis=0), bounds[1] - bounds[0]
    look_at = np.array([centre[0], centre[1], min(0.5, bounds[1][2] / 2)])
    distance = max(2.5, 0.66 * float(np.linalg.norm(extent[:2])))
    direction = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    position = look_at + distance * direction
    return Eye(tuple(position.tolist()), tuple(look_at.tolist()))


def build_blueprint(tree: NodeList, eye: Eye, cameras: Sequence[str], plots: Sequence[str]) -> rrb.Blueprint:
    """Return the viewer layout for a run with these cameras and plotted entities."""
    import rerun.blueprint as rrb

    below_scene = [*_camera_views(cameras), *_plots(plots)]
    scene = _scene_view(eye, cameras)
    left = rrb.Vertical(scene, rrb.Horizontal(*below_scene), row_shares=[3, 2]) if below_scene else scene
    right = rrb.Vertical(
        _graph_view(tree),
        rrb.Horizontal(_lanes_view(tree), rrb.Tabs(*_log_views(), active_tab=0), column_shares=[1, 1]),
        row_shares=[3, 2],
    )
    return rrb.Blueprint(
        rrb.Horizontal(left, right, column_shares=[1, 1]),
        rrb.TimePanel(state="collapsed", timeline=entities.SIM_TIME),
        collapse_panels=True,
        auto_views=False,
        auto_layout=False,
    )


def _scene_view(eye: Eye, cameras: Sequence[str]) -> rrb.Spatial3DView:
    import rerun.blueprint as rrb

    return rrb.Spatial3DView(
        origin=entities.WORLD,
        name="scene",
        contents=["$origin/**", *(f"- /{entities.camera_entity(camera)}/depth" for camera in cameras)],
        background=BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=True, spacing=1.0, color=(255, 255, 255, 25)),
        spatial_information=rrb.SpatialInformation(target_frame=entities.MAP_FRAME),
        eye_controls=rrb.EyeControls3D(position=eye.position, look_target=eye.look_at, eye_up=[0, 0, 1]),
    )


def _camera_views(cameras: Sequence[str]) -> list[rrb.Tabs]:
    import rerun.blueprint as rrb

    return [
        rrb.Tabs(
            *(
                rrb.Spatial2DView(
                    origin=entities.camera_entity(camera),
                    contents=[f"$origin/{part}"],
                    name=f"{camera} {word}",
                    background=BACKGROUND,
                )
                for part, word in (("rgb", "colour"), ("depth", "depth"))
            ),
            active_tab=0,
        )
        for camera in cameras
    ]


def _plots(plots: Sequence[str]) -> list[rrb.Tabs]:
    import rerun.blueprint as rrb

    views = [rrb.TimeSeriesView(origin=plot, name=plot) for plot in plots]
    return [rrb.Tabs(*views, active_tab=0)] if views else []


def _graph_view(tree: NodeList) -> rrb.GraphView:
    import rerun.blueprint as rrb

    width, height = TreeGraph.layout(tree).size
    return rrb.GraphView(
        origin=entities.TREE_GRAPH,
        name="tree",
        background=rrb.archetypes.GraphBackground(color=BACKGROUND),
        visual_bounds=rrb.VisualBounds2D(
            x_range=[-GRAPH_MARGIN, width + GRAPH_MARGIN], y_range=[-GRAPH_MARGIN, height + GRAPH_MARGIN]
        ),
    )


def _lanes_view(tree: NodeList) -> rrb.StateTimelineView:
    import rerun.blueprint as rrb

    lanes = lane_entities(tree)
    return rrb.StateTimelineView(
        origin=entities.NODES,
        name="what the leaves did",
        contents=[f"/{lanes[leaf.uid]}" for leaf in tree.leaves()],
    )


def _log_views() -> list[rrb.TextLogView]:
    import rerun.blueprint as rrb

    columns = [
        rrb.encodings.TextLogColumn(rrb.encodings.TextLogColumnKind.LogLevel),
        rrb.encodings.TextLogColumn(rrb.encodings.TextLogColumnKind.Body),
    ]
    return [
        rrb.TextLogView(
            origin=origin,
            name=origin,
            columns=rrb.TextLogColumns(
                timeline_columns=[rrb.encodings.TimelineColumn(entities.SIM_TIME, visible=True)],
                text_log_columns=columns[skipped:],
            ),
        )
        for origin, skipped in ((entities.LOG, 0), (entities.BLACKBOARD, 1))
    ]
