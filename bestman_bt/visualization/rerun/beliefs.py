"""The robot's beliefs in the scene: its map, the perceived objects, the grasp candidates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bestman_bt.visualization.marks import GRASP_COLOR, GraspMark, ObjectMark, box_edges, grasp_lines, object_color
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.bodies import write_pose

if TYPE_CHECKING:
    import rerun as rr

MAP_COLOR = (120, 200, 200)
MAP_HEIGHT = 0.01
LATER_GRASP_COLOR = (150, 150, 160)


def write_map(
    recording: rr.RecordingStream, walls: NDArray[np.float64], outlines: Mapping[str, NDArray[np.float64]]
) -> None:
    """Write the robot's map on the floor, for the whole recording.

    ``walls``: (N, 4) metres, x and y of both ends. ``outlines``: name of furniture → its (M, 2) corners.
    """
    import rerun as rr

    strips = [wall.reshape(2, 2) for wall in walls] + [np.vstack([line, line[:1]]) for line in outlines.values()]
    labels = [""] * len(walls) + list(outlines)
    lines = [np.column_stack([strip, np.full(len(strip), MAP_HEIGHT)]).astype(np.float32) for strip in strips]
    recording.log(
        entities.MAP,
        rr.LineStrips3D(lines, colors=MAP_COLOR, radii=0.006, labels=labels, show_labels=False),
        static=True,
    )


def write_object(recording: rr.RecordingStream, entity: str, index: int, found: ObjectMark) -> None:
    """Write the believed pose of an object: its box, its measured points, and a triad."""
    import rerun as rr

    lower, upper = found.model.bounds()
    edges = box_edges(found.pose, lower, upper).astype(np.float32)
    color = object_color(index)
    label = f"{found.name} {found.confidence:.2f}" if found.recognised else found.name
    recording.log(f"{entity}/box", rr.LineStrips3D(edges, colors=color, radii=0.0015, labels=[label]))
    recording.log(f"{entity}/points", rr.Points3D(found.points.astype(np.float32), colors=color, radii=0.002))
    write_pose(recording, found.name, found.pose, 0.6 * float(found.model.size.max()), label)


def clear_object(recording: rr.RecordingStream, entity: str, name: str) -> None:
    """Remove an object that is no longer believed to exist."""
    import rerun as rr

    for gone in (entity, f"{entities.MARKERS}/{entities.part(name)}"):
        recording.log(gone, rr.Clear(recursive=True))


def write_grasps(recording: rr.RecordingStream, entity: str, grasps: Sequence[GraspMark]) -> None:
    """Write grasps as lines, the first and best one brighter; an empty list removes them."""
    import rerun as rr

    lines = [grasp_lines(grasp).astype(np.float32) for grasp in grasps]
    colors = [GRASP_COLOR if number == 0 else LATER_GRASP_COLOR for number in range(len(grasps)) for _ in range(4)]
    radii = [0.002 if number == 0 else 0.001 for number in range(len(grasps)) for _ in range(4)]
    strips = np.concatenate(lines) if lines else np.empty((0, 2, 3), dtype=np.float32)
    recording.log(entity, rr.LineStrips3D(strips, colors=colors, radii=radii))
