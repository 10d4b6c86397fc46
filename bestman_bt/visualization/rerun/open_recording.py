"""What exists while a recording is open: its constants are written at once, everything else as it happens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bestman_bt.messages import CameraIntrinsics
from bestman_bt.records.events import TreeEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.visualization.rerun import entities, markers, sensed
from bestman_bt.visualization.rerun.blueprint import Eye, build_blueprint, eye_on
from bestman_bt.visualization.rerun.bodies import body_frame, bounds, write_body, write_floor
from bestman_bt.visualization.rerun.frame_transforms import FrameTransforms
from bestman_bt.visualization.rerun.robot import RecordedRobot
from bestman_bt.visualization.rerun.sensed import SensorRecording
from bestman_bt.visualization.rerun.series import TimeSeries
from bestman_bt.visualization.rerun.state_lanes import StateLanes
from bestman_bt.visualization.rerun.tree_graph import TreeGraph
from bestman_bt.visualization.snapshot import RecordedBody

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb


@dataclass(frozen=True)
class RecordedCamera:
    """A camera of the robot: its pinhole model and the link of its optical frame."""

    intrinsics: CameraIntrinsics
    optical_frame: str


@dataclass(frozen=True, eq=False)
class Announced:
    """All that a recording is told before it is opened; as the arguments of ``RerunRecorder``."""

    urdf: str
    base_frame: str
    tree: TreeEvent
    bodies: Mapping[str, RecordedBody]
    cameras: Mapping[str, RecordedCamera]
    plotted_joints: tuple[str, ...]
    grippers: Mapping[str, tuple[str, ...]]
    eye: Eye | None
    sensors: SensorRecording

    def blueprint(self) -> rrb.Blueprint:
        """How the recording looks when it is opened."""
        plots = [entities.JOINTS] * bool(self.plotted_joints) + [entities.GRIPPERS] * bool(self.grippers)
        eye = self.eye or eye_on(bounds(self.bodies.values()))
        return build_blueprint(_history(self.tree).nodes, eye, list(self.cameras), plots)


class OpenRecording:
    """The parts that write to ``stream``, and the time of what is written next."""

    def __init__(self, stream: rr.RecordingStream, announced: Announced) -> None:
        self.stream = stream
        self.robot = RecordedRobot(announced.urdf, announced.base_frame)
        self.transforms = FrameTransforms(stream)
        self.history = _history(announced.tree)
        self.graph = TreeGraph(stream, self.history.nodes)
        self.lanes = StateLanes(stream, self.history.nodes)
        self.joints = TimeSeries(stream, entities.JOINTS, announced.plotted_joints)
        self.widths = TimeSeries(stream, entities.GRIPPERS, tuple(f"{name} width" for name in announced.grippers))
        self.driven = markers.DrivenPath()
        self.has_belief = False
        self.objects: dict[str, str] = {}
        """Entities of the objects that are believed in."""
        self._tick = 0
        self._announced = announced

    def write_constants(self) -> None:
        """Write all that does not change; RecordingError for a robot that cannot be shown."""
        import rerun as rr

        stream, announced = self.stream, self._announced
        stream.log(
            entities.WORLD,
            rr.ViewCoordinates.RIGHT_HAND_Z_UP,
            rr.Transform3D(translation=(0.0, 0.0, 0.0), parent_frame=entities.MAP_FRAME),
            static=True,
        )
        self.robot.write_model(stream)
        for name, camera in announced.cameras.items():
            sensed.write_camera(stream, name, camera.optical_frame, camera.intrinsics, announced.sensors.frustum_length)
        write_floor(stream, bounds(announced.bodies.values()))
        for body in announced.bodies.values():
            write_body(stream, body)
        self.graph.write_shape()
        self.lanes.write_styles()
        self.joints.write_styles()
        self.widths.write_styles()
        self.set_time(0.0)
        self.graph.write_colors(self.history.states.now)
        for body in announced.bodies.values():
            self.transforms.add_pose(entities.MAP_FRAME, body_frame(body.name), body.pose)
        self.transforms.write(0.0, 0)

    def set_time(self, stamp: float, tick: int | None = None) -> None:
        """Set the time of what is written next; ``tick``: None for the one before."""
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
