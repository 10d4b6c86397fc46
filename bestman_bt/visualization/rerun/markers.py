"""Things drawn into the scene that are not bodies: poses, goals, paths, where the robot believes to be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose
from bestman_bt.visualization.rerun import entities

if TYPE_CHECKING:
    import rerun as rr

GOAL_COLOR = (235, 60, 200)
BELIEF_COLOR = (70, 170, 255)
DRIVEN_COLOR = (90, 150, 255)
PLANNED_COLOR = (255, 190, 40)
BELIEF_FRAME = "belief/base"
PATH_HEIGHT = 0.02
UP = np.array([0.0, 0.0, 1.0])


def write_pose(recording: rr.RecordingStream, name: str, map_from_pose: Pose, axis_length: float, label: str) -> None:
    """Write a named triad: x red, y green, z blue."""
    import rerun as rr

    axes = map_from_pose.rotation * axis_length
    recording.log(
        f"{entities.MARKERS}/{entities.part(name)}",
        rr.Arrows3D(
            origins=np.tile(map_from_pose.position, (3, 1)),
            vectors=axes.T,
            colors=[(230, 70, 70), (80, 200, 90), (80, 130, 255)],
            radii=axis_length * 0.04,
        ),
    )
    write_label(recording, name, map_from_pose.position, label)


def write_goal(recording: rr.RecordingStream, name: str, point: NDArray[np.float64], label: str) -> None:
    """Write a pin that stands on a point of the map."""
    import rerun as rr

    tip = np.asarray(point, dtype=float)
    recording.log(
        f"{entities.MARKERS}/{entities.part(name)}",
        rr.Arrows3D(origins=[tip + 0.35 * UP], vectors=[-0.34 * UP], colors=GOAL_COLOR, radii=0.012),
    )
    write_label(recording, name, tip + 0.45 * UP, label)


def clear(recording: rr.RecordingStream, name: str) -> None:
    """Remove a triad or a goal."""
    import rerun as rr

    recording.log(f"{entities.MARKERS}/{entities.part(name)}", rr.Clear(recursive=True))


def write_label(recording: rr.RecordingStream, name: str, position: NDArray[np.float64], label: str) -> None:
    """Write a text at a point of the map."""
    import rerun as rr

    recording.log(
        f"{entities.MARKERS}/{entities.part(name)}/label",
        rr.Points3D([position], labels=[label], show_labels=True, radii=0.003, colors=(255, 255, 255)),
    )


def write_path(
    recording: rr.RecordingStream, name: str, points: NDArray[np.float64], color: tuple[int, int, int]
) -> None:
    """Write a path on the floor from (N, 2) points of the map, metres."""
    import rerun as rr

    strip = np.column_stack([points, np.full(len(points), PATH_HEIGHT)]).astype(np.float32)
    recording.log(f"{entities.PATHS}/{entities.part(name)}", rr.LineStrips3D([strip], colors=color, radii=0.008))


def write_belief(recording: rr.RecordingStream) -> None:
    """Write the mark that stands for where the robot believes to be, on a frame of its own."""
    import rerun as rr

    recording.log(
        f"{entities.MARKERS}/belief",
        rr.Arrows3D(origins=[(0.0, 0.0, PATH_HEIGHT)], vectors=[(0.5, 0.0, 0.0)], colors=BELIEF_COLOR, radii=0.012),
        rr.CoordinateFrame(BELIEF_FRAME),
        static=True,
    )


class DrivenPath:
    """The trail of the base: grows by a point when the base has moved by ``step`` metres."""

    def __init__(self, step: float = 0.05) -> None:
        self._step = step
        self._points: list[NDArray[np.float64]] = []

    def extend(self, position: NDArray[np.float64]) -> bool:
        """Take the base's position, (2,) metres; True if the trail grew."""
        if self._points and np.linalg.norm(position - self._points[-1]) < self._step:
            return False
        self._points.append(np.array(position, dtype=float))
        return True

    @property
    def points(self) -> NDArray[np.float64]:
        """The trail, (N, 2) metres."""
        return np.array(self._points).reshape(-1, 2)
