"""A run as a Rerun recording: robot, scene, cameras, tree and joints on one timeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from bestman_bt.engine.status import FAILURE, RUNNING, SUCCESS
from bestman_bt.messages import CameraIntrinsics, LaserScan, Path2D, PointCloud, Pose, RGBDImage
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.node_states import NodeStates
from bestman_bt.visualization.rerun import entities, markers, sensed
from bestman_bt.visualization.rerun.blueprint import Eye, build_blueprint, eye_on
from bestman_bt.visualization.rerun.bodies import body_frame, bounds, write_body, write_floor
from bestman_bt.visualization.rerun.frame_transforms import FrameTransforms
from bestman_bt.visualization.rerun.robot import RecordedRobot
from bestman_bt.visualization.rerun.sensed import SensorRecording
from bestman_bt.visualization.rerun.series import TimeSeries
from bestman_bt.visualization.rerun.state_lanes import StateLanes
from bestman_bt.visualization.rerun.tree_graph import TreeGraph
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot
from bestman_bt.visualization.tree_description import DescribedNode, NodeTransition, TreeDescription

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

LOG_LEVELS = ("DEBUG", "INFO", "WARN", "ERROR")
LEVEL_OF_STATE = {RUNNING: "INFO", SUCCESS: "INFO", FAILURE: "WARN"}


@dataclass(frozen=True)
class RecordedCamera:
    """A camera of the robot: its pinhole model and the link of its optical frame."""

    intrinsics: CameraIntrinsics
    optical_frame: str


@dataclass
class _Parts:
    """What exists while the file is open."""

    recording: rr.RecordingStream
    robot: RecordedRobot
    transforms: FrameTransforms
    graph: TreeGraph
    lanes: StateLanes
    joints: TimeSeries
    widths: TimeSeries
    states: NodeStates
    driven: markers.DrivenPath
    tick: int = 0
    has_belief: bool = False


class RerunRecorder:
    """Writes a run to ``path`` (``.rrd``) while it happens; a context manager.

    ``urdf``: the robot's URDF text, meshes by absolute path; ``base_frame``: the link whose pose snapshots give.
    ``nodes``: the tree, parents before children. ``plotted_joints``: drawn over time, radians or metres.
    ``grippers``: gripper name → finger joints, whose sum is the opening width. ``eye``: viewpoint, None for one
    that shows all bodies.

    Nothing is opened before ``open``. Data reaches the disk within half a second, so that an interrupted run
    leaves a recording that opens. Stamps are seconds of the robot's clock and never go back.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        urdf: str,
        base_frame: str,
        nodes: Sequence[DescribedNode],
        bodies: Sequence[RecordedBody] = (),
        cameras: Mapping[str, RecordedCamera] | None = None,
        plotted_joints: Sequence[str] = (),
        grippers: Mapping[str, Sequence[str]] | None = None,
        eye: Eye | None = None,
        sensors: SensorRecording | None = None,
        application_id: str = "bestman_bt",
    ) -> None:
        self.file = Path(path)
        self._urdf = urdf
        self._base_frame = base_frame
        self._tree = TreeDescription(nodes)
        self._bodies = {body.name: body for body in bodies}
        self._cameras = dict(cameras or {})
        self._plotted_joints = tuple(plotted_joints)
        self._grippers = {name: tuple(joints) for name, joints in (grippers or {}).items()}
        self._eye = eye
        self._sensors = sensors or SensorRecording()
        self._application_id = application_id
        self._parts: _Parts | None = None

    def open(self) -> None:
        """Create the file and write all that does not change; RecordingError if that is not possible."""
        if self._parts is not None:
            raise RecordingError(f"the recording {self.file} is open already")
        import rerun as rr

        recording = rr.RecordingStream(self._application_id, recording_id=self.file.stem)
        try:
            recording.save(self.file, default_blueprint=self._blueprint())
        except (RuntimeError, OSError) as error:
            raise RecordingError(f"the recording {self.file} cannot be written: {error}") from error
        parts = _Parts(
            recording,
            RecordedRobot(self._urdf, self._base_frame),
            FrameTransforms(recording),
            TreeGraph(recording, self._tree),
            StateLanes(recording, self._tree),
            TimeSeries(recording, entities.JOINTS, self._plotted_joints),
            TimeSeries(recording, entities.GRIPPERS, tuple(f"{name} width" for name in self._grippers)),
            NodeStates(self._tree),
            markers.DrivenPath(),
        )
        self._parts = parts
        try:
            self._write_constants(parts)
        except RecordingError:
            self.close()
            raise

    def close(self) -> None:
        """Write what is pending and close the file; nothing if it is closed."""
        if self._parts is not None:
            self._parts.recording.flush()
            self._parts.recording.disconnect()
            self._parts = None

    def __enter__(self) -> RerunRecorder:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def snapshot(self, snapshot: RobotSnapshot) -> None:
        """Record where everything is; RecordingError for joints or bodies that the recording does not have."""
        parts = self._at(snapshot.stamp, snapshot.tick)
        parts.robot.place(parts.transforms, snapshot.map_from_base, snapshot.joint_positions)
        for name, pose in snapshot.body_poses.items():
            if name not in self._bodies:
                raise RecordingError(
                    f"snapshot: body {name!r} was not announced; there are {', '.join(self._bodies) or 'none'}"
                )
            parts.transforms.add_pose(entities.MAP_FRAME, body_frame(name), pose)
        if snapshot.believed_map_from_base is not None:
            if not parts.has_belief:
                markers.write_belief(parts.recording)
                parts.has_belief = True
            parts.transforms.add_pose(entities.MAP_FRAME, markers.BELIEF_FRAME, snapshot.believed_map_from_base)
        parts.transforms.write(snapshot.stamp, snapshot.tick)
        joints = snapshot.joint_positions
        parts.joints.write([joints.get(name, np.nan) for name in self._plotted_joints])
        parts.widths.write([sum(joints.get(name, np.nan) for name in names) for names in self._grippers.values()])
        if parts.driven.extend(snapshot.map_from_base.position[:2]):
            markers.write_path(parts.recording, "driven", parts.driven.points, markers.DRIVEN_COLOR)

    def transitions(self, batch: Sequence[NodeTransition], tick: int | None = None) -> None:
        """Record the state changes of one tick, in their order; ``tick``: None for the one of the last snapshot."""
        if not batch:
            return
        parts = self._at(batch[-1].stamp, tick)
        parts.states.apply(batch)
        parts.graph.write_colors(parts.states)
        parts.lanes.write(batch)
        for transition in batch:
            if transition.message:
                node = self._tree.node(transition.uid)
                level = LEVEL_OF_STATE.get(transition.state, "DEBUG")
                self._log(parts, level, f"{node_label(node)}: {transition.message}")

    def image(self, camera: str, image: RGBDImage) -> None:
        """Record a camera image at its stamp; RecordingError for a camera that was not announced."""
        if camera not in self._cameras:
            raise RecordingError(
                f"image: camera {camera!r} was not announced; there are {', '.join(self._cameras) or 'none'}"
            )
        sensed.write_image(self._at(image.stamp).recording, camera, image, self._sensors)

    def cloud(self, name: str, cloud: PointCloud, stamp: float) -> None:
        """Record a cloud in the map frame."""
        sensed.write_cloud(self._at(stamp).recording, name, cloud, self._sensors)

    def scan(self, name: str, scan: LaserScan, map_from_lidar: Pose) -> None:
        """Record the hits of a scan at its stamp."""
        sensed.write_scan(self._at(scan.stamp).recording, name, scan, map_from_lidar)

    def path(self, name: str, path: Path2D, stamp: float) -> None:
        """Record a path in the map frame; the next one of this name replaces it."""
        markers.write_path(self._at(stamp).recording, name, path.points, markers.PLANNED_COLOR)

    def pose(self, name: str, map_from_pose: Pose, stamp: float, axis_length: float = 0.08) -> None:
        """Record a named triad, for example a detected object or a grasp; ``axis_length`` in metres."""
        markers.write_pose(self._at(stamp).recording, name, map_from_pose, axis_length, name)

    def clear(self, name: str, stamp: float) -> None:
        """Remove the triad ``name`` from the scene, from ``stamp`` on."""
        markers.clear(self._at(stamp).recording, name)

    def goal(self, point: ArrayLike, stamp: float, label: str = "goal") -> None:
        """Record a pin on a point of the map, (3,) metres; the next one of this label replaces it."""
        markers.write_goal(self._at(stamp).recording, label, np.asarray(point, dtype=float), label)

    def text(self, level: str, message: str, stamp: float) -> None:
        """Record a line of the log; ``level``: DEBUG, INFO, WARN or ERROR."""
        if level not in LOG_LEVELS:
            raise RecordingError(f"text: level should be one of {', '.join(LOG_LEVELS)} but is {level!r}")
        self._log(self._at(stamp), level, message)

    def _at(self, stamp: float, tick: int | None = None) -> _Parts:
        """Set the time of what is written next."""
        if self._parts is None:
            raise RecordingError(f"the recording {self.file} is not open")
        if tick is not None:
            self._parts.tick = tick
        self._parts.recording.set_time(entities.SIM_TIME, duration=stamp)
        self._parts.recording.set_time(entities.TICK, sequence=self._parts.tick)
        return self._parts

    def _write_constants(self, parts: _Parts) -> None:
        import rerun as rr

        parts.recording.log(
            entities.WORLD,
            rr.ViewCoordinates.RIGHT_HAND_Z_UP,
            rr.Transform3D(translation=(0.0, 0.0, 0.0), parent_frame=entities.MAP_FRAME),
            static=True,
        )
        parts.robot.write_model(parts.recording)
        for name, camera in self._cameras.items():
            sensed.write_camera(
                parts.recording, name, camera.optical_frame, camera.intrinsics, self._sensors.frustum_length
            )
        write_floor(parts.recording, bounds(self._bodies.values()))
        for body in self._bodies.values():
            write_body(parts.recording, body)
        parts.graph.write_shape()
        parts.lanes.write_styles()
        parts.joints.write_styles()
        parts.widths.write_styles()
        self._at(0.0)
        parts.graph.write_colors(parts.states)
        for body in self._bodies.values():
            parts.transforms.add_pose(entities.MAP_FRAME, body_frame(body.name), body.pose)
        parts.transforms.write(0.0, 0)

    def _blueprint(self) -> rrb.Blueprint:
        plots = [entities.JOINTS] * bool(self._plotted_joints) + [entities.GRIPPERS] * bool(self._grippers)
        eye = self._eye or eye_on(bounds(self._bodies.values()))
        return build_blueprint(self._tree, eye, list(self._cameras), plots)

    @staticmethod
    def _log(parts: _Parts, level: str, message: str) -> None:
        import rerun as rr

        parts.recording.log(entities.LOG, rr.TextLog(message, level=level))
