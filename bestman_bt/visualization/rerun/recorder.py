"""A run as a Rerun recording: robot, scene, cameras, tree and joints on one timeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.extras import require_extra
from bestman_bt.messages import LaserScan, Path2D, PointCloud, Pose, RGBDImage
from bestman_bt.records.events import StatesEvent
from bestman_bt.records.states import NO
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.marks import GraspMark, ObjectMark
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.rerun import beliefs, bodies, entities, sensed
from bestman_bt.visualization.rerun.bodies import body_frame
from bestman_bt.visualization.rerun.open_recording import OpenRecording, RecordingSetup
from bestman_bt.visualization.snapshot import RobotSnapshot

RECORDING_NAME = "recording.rrd"
"""Name of the recording in the folder of a run."""
LOG_LEVELS = ("DEBUG", "INFO", "WARN", "ERROR")
LEVEL_OF_STATE = {RUNNING: "INFO", SUCCESS: "INFO", NO: "INFO", FAILURE: "WARN"}


class RerunRecorder:
    """Writes a run to ``path`` (``.rrd``) while it happens; a context manager.

    Nothing is opened before ``open``. Data is written to disk within half a second, so that the recording of an
    interrupted run can be opened. Stamps are seconds of the robot's clock and never go back.
    """

    def __init__(
        self,
        path: Path | str,
        setup: RecordingSetup,
        application_id: str = "bestman_bt",
    ) -> None:
        self.file = Path(path)
        self._setup = setup
        self._bodies = [body.name for body in setup.bodies]
        self._application_id = application_id
        self._open: OpenRecording | None = None

    def open(self) -> None:
        """Create the file and write everything that does not change. Raises RecordingError if that is not possible.

        MissingExtraError without rerun.
        """
        if self._open is not None:
            raise RecordingError(f"the recording {self.file} is open already")
        require_extra("a recording", "rerun")
        import rerun as rr

        file = self.file.resolve()
        # The id tells it from other recordings in one viewer.
        stream = rr.RecordingStream(self._application_id, recording_id=f"{file.parent.name}-{file.stem}")
        try:
            stream.save(self.file, default_blueprint=self._setup.blueprint())
        except (RuntimeError, OSError) as error:
            raise RecordingError(f"the recording {self.file} cannot be written: {error}") from error
        self._open = OpenRecording(stream, self._setup)
        try:
            self._open.write_constants()
        except RecordingError:
            self.close()
            raise

    def close(self) -> None:
        """Write the pending rows and close the file; does nothing if it is closed. Raises OSError if writing fails."""
        if self._open is not None:
            stream, self._open = self._open.stream, None
            try:
                stream.flush()
            except RuntimeError as error:  # of rerun, whose file has ended, as on a full disk
                raise OSError(str(error)) from error
            finally:
                stream.disconnect()

    def __enter__(self) -> RerunRecorder:
        self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def snapshot(self, snapshot: RobotSnapshot) -> None:
        """Record the poses of a moment. Raises RecordingError for unknown joints or bodies."""
        parts = self._at(snapshot.stamp, snapshot.tick)
        parts.robot.place(parts.transforms, snapshot.map_from_base, snapshot.joint_positions)
        for name, pose in snapshot.body_poses.items():
            if name not in self._bodies:
                there = ", ".join(self._bodies) or "none"
                raise RecordingError(f"snapshot: body {name!r} was not announced; there are {there}")
            parts.transforms.add_pose(entities.MAP_FRAME, body_frame(name), pose)
        if snapshot.believed_map_from_base is not None:
            if not parts.has_belief:
                bodies.write_belief(parts.stream)
                parts.has_belief = True
            parts.transforms.add_pose(entities.MAP_FRAME, bodies.BELIEF_FRAME, snapshot.believed_map_from_base)
        parts.transforms.write(snapshot.stamp, snapshot.tick)
        joints = snapshot.joint_positions
        parts.joints.write([joints.get(name, np.nan) for name in self._setup.plotted_joints])
        grippers = self._setup.grippers.values()
        parts.widths.write([sum(joints.get(name, np.nan) for name in names) for names in grippers])
        if parts.driven.extend(snapshot.map_from_base.position[:2]):
            bodies.write_path(parts.stream, "driven", parts.driven.points, bodies.DRIVEN_COLOR)

    def changes(self, event: StatesEvent) -> None:
        """Record the state changes of one tick of the main tree, and the messages of its nodes."""
        if not event.changes:
            return
        parts = self._at(event.time, event.tick)
        shown = parts.history.shown(event)
        parts.history.take(event)
        parts.graph.write_colors(parts.history.states.now)
        parts.lanes.write(shown)
        for change in shown:
            message = event.messages.get(change.uid)
            if message and change.status != IDLE:
                level = LEVEL_OF_STATE.get(change.status, "DEBUG")
                parts.write_line(level, f"{node_label(parts.history.nodes.node(change.uid))}: {message}")

    def image(self, camera: str, image: RGBDImage) -> None:
        """Record a camera image at its stamp. Raises RecordingError for a camera that was not announced."""
        if camera not in self._setup.cameras:
            raise RecordingError(
                f"image: camera {camera!r} was not announced; there are {', '.join(self._setup.cameras) or 'none'}"
            )
        sensed.write_image(self._at(image.stamp).stream, camera, image, self._setup.sensors)

    def cloud(self, name: str, cloud: PointCloud, stamp: float) -> None:
        """Record a cloud in the map frame."""
        sensed.write_cloud(self._at(stamp).stream, name, cloud, self._setup.sensors)

    def scan(self, name: str, scan: LaserScan, map_from_lidar: Pose) -> None:
        """Record the hits of a scan at its stamp."""
        sensed.write_scan(self._at(scan.stamp).stream, name, scan, map_from_lidar)

    def path(self, name: str, path: Path2D | None, stamp: float) -> None:
        """Record a path in the map frame; the next one of this name replaces it, None removes it."""
        points = np.empty((0, 2)) if path is None else path.points
        bodies.write_path(self._at(stamp).stream, name, points, bodies.PLANNED_COLOR)

    def map(self, walls: NDArray[np.float64], outlines: Mapping[str, NDArray[np.float64]]) -> None:
        """Record the robot's map: (N, 4) ends of walls, and (M, 2) corners of furniture by name."""
        beliefs.write_map(self._at(0.0).stream, walls, outlines)

    def objects(self, found: Sequence[ObjectMark], stamp: float) -> None:
        """Record the believed poses of objects; objects that are no longer listed are removed."""
        parts = self._at(stamp)
        for name in parts.objects.keys() - {mark.name for mark in found}:
            beliefs.clear_object(parts.stream, parts.objects.pop(name), name)
        for mark in found:
            entity = parts.objects.setdefault(mark.name, f"{entities.BELIEFS}/{entities.part(mark.name)}")
            beliefs.write_object(parts.stream, entity, list(parts.objects).index(mark.name), mark)

    def grasps(self, candidates: Sequence[GraspMark], stamp: float) -> None:
        """Record candidate grasps, best first; they replace the previous ones."""
        beliefs.write_grasps(self._at(stamp).stream, entities.GRASPS, candidates)

    def blackboard(self, change: str, stamp: float) -> None:
        """Record a change of the blackboard as text."""
        self._at(stamp).write_line("DEBUG", change, entities.BLACKBOARD)

    def pose(self, name: str, map_from_pose: Pose, stamp: float, axis_length: float = 0.08) -> None:
        """Record a named triad, for example a detected object or a grasp; ``axis_length`` in metres."""
        bodies.write_pose(self._at(stamp).stream, name, map_from_pose, axis_length, name)

    def clear(self, name: str, stamp: float) -> None:
        """Remove the triad ``name`` from the scene, from ``stamp`` on."""
        bodies.clear(self._at(stamp).stream, name)

    def goal(self, point: ArrayLike, stamp: float, label: str = "goal") -> None:
        """Record a pin on a point of the map, (3,) metres; the next one of this label replaces it."""
        bodies.write_goal(self._at(stamp).stream, label, np.asarray(point, dtype=float), label)

    def text(self, level: str, message: str, stamp: float) -> None:
        """Record a line of the log; ``level``: DEBUG, INFO, WARN or ERROR."""
        if level not in LOG_LEVELS:
            raise RecordingError(f"text: level should be one of {', '.join(LOG_LEVELS)} but is {level!r}")
        self._at(stamp).write_line(level, message)

    def _at(self, stamp: float, tick: int | None = None) -> OpenRecording:
        """Set the time of the following rows."""
        if self._open is None:
            raise RecordingError(f"the recording {self.file} is not open")
        self._open.set_time(stamp, tick)
        return self._open
