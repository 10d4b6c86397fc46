"""Bodies of the scene: solid shapes, each with its own frame."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere
from bestman_bt.messages.shapes import bounding_corners
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.snapshot import RecordedBody

if TYPE_CHECKING:
    import rerun as rr


# All moving frames of a run on one entity: a snapshot costs one call, whatever the number of frames.
# Logged one by one, 25 transforms take 5 ms; as rows of one chunk they take 0.4 ms.


STILL = 1e-6


class FrameTransforms:
    """Collects parent_from_child transforms of one moment and writes those that changed."""

    def __init__(self, recording: rr.RecordingStream) -> None:
        self._recording = recording
        self._written: dict[str, NDArray[np.float64]] = {}
        self._rows: dict[str, tuple[str, NDArray[np.float64]]] = {}

    def add(self, parent: str, child: str, translation: NDArray[np.float64], quaternion: NDArray[np.float64]) -> None:
        """Set the transform of ``child`` in ``parent``: (3,) metres and (4,) xyzw."""
        row = np.concatenate([translation, quaternion])
        before = self._written.get(child)
        if before is None or np.abs(row - before).max() > STILL:
            self._rows[child] = (parent, row)

    def add_pose(self, parent: str, child: str, parent_from_child: Pose) -> None:
        """Add a transform given as a pose."""
        self.add(parent, child, parent_from_child.position, parent_from_child.quaternion)

    def write(self, stamp: float, tick: int) -> int:
        """Write the changes since the last call, at ``stamp`` seconds and ``tick``. Returns the number of rows."""
        if not self._rows:
            return 0
        import rerun as rr

        count = len(self._rows)
        values = np.stack([row for _, row in self._rows.values()])
        self._recording.send_columns(
            entities.TRANSFORMS,
            indexes=[
                rr.TimeColumn(entities.SIM_TIME, duration=np.full(count, stamp)),
                rr.TimeColumn(entities.TICK, sequence=np.full(count, tick, dtype=np.int64)),
            ],
            columns=rr.Transform3D.columns(
                translation=values[:, :3],
                quaternion=values[:, 3:],
                parent_frame=[parent for parent, _ in self._rows.values()],
                child_frame=list(self._rows),
            ),
        )
        for child, (_, row) in self._rows.items():
            self._written[child] = row
        self._rows.clear()
        return count


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
    """Write a pin at a point of the map."""
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
    """Write a text at a point of the map, (3,) metres."""
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
    """Write the mark of the robot's believed pose, in a separate frame."""
    import rerun as rr

    recording.log(
        f"{entities.MARKERS}/belief",
        rr.Arrows3D(origins=[(0.0, 0.0, PATH_HEIGHT)], vectors=[(0.5, 0.0, 0.0)], colors=BELIEF_COLOR, radii=0.012),
        rr.CoordinateFrame(BELIEF_FRAME),
        static=True,
    )


class BaseTrail:
    """The trail of the base: grows by a point when the base has moved by ``step`` metres."""

    def __init__(self, step: float = 0.05) -> None:
        self._step = step
        self._points: list[NDArray[np.float64]] = []

    def extend(self, position: NDArray[np.float64]) -> bool:
        """Append the base's position, (2,) metres. Returns whether the trail grew."""
        if self._points and np.linalg.norm(position - self._points[-1]) < self._step:
            return False
        self._points.append(np.array(position, dtype=float))
        return True

    @property
    def points(self) -> NDArray[np.float64]:
        """The trail, (N, 2) metres."""
        return np.array(self._points).reshape(-1, 2)


SEE_THROUGH_BELOW = 0.99
FLOOR_COLOR = (0.5, 0.52, 0.56, 1.0)
FLOOR_MARGIN, FLOOR_THICKNESS = 0.2, 0.02
FLOOR_GAP = 0.002
"""Metres below z = 0, so that the floor does not hide marks on it."""


def body_frame(name: str) -> str:
    """Return the coordinate frame of a body."""
    return f"body/{name}"


def write_body(recording: rr.RecordingStream, body: RecordedBody) -> None:
    """Write the shapes of a body in its frame; its pose is a separate transform."""
    import rerun as rr

    for index, (placed, color) in enumerate(zip(body.shapes, body.colors, strict=True)):
        recording.log(
            f"{entities.SCENE}/{entities.part(body.name)}/{index}",
            _archetype(placed, color),
            rr.CoordinateFrame(body_frame(body.name)),
            static=True,
        )


def write_floor(recording: rr.RecordingStream, box: NDArray[np.float64]) -> None:
    """Write a plate under a (2, 3) bounding box of the map frame; its top is the plane z = 0."""
    import rerun as rr

    size = np.array([*(box[1] - box[0])[:2] + 2 * FLOOR_MARGIN, FLOOR_THICKNESS])
    centre = np.array([*box.mean(axis=0)[:2], -FLOOR_THICKNESS / 2 - FLOOR_GAP])
    recording.log(
        entities.FLOOR,
        rr.Boxes3D(sizes=[size], centers=[centre], colors=[FLOOR_COLOR], fill_mode=rr.components.FillMode.Solid),
        static=True,
    )


def bounds(bodies: Iterable[RecordedBody]) -> NDArray[np.float64]:
    """Return the bounding box of bodies in the map frame: (2, 3) metres; (2, 3) zeros for none."""
    corners = [
        body.pose.apply(placed.pose.apply(bounding_corners(placed.shape))) for body in bodies for placed in body.shapes
    ]
    if not corners:
        return np.zeros((2, 3))
    points = np.concatenate(corners)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _archetype(placed: PlacedShape, color: tuple[float, float, float, float]) -> Any:
    import rerun as rr

    shape, pose = placed.shape, placed.pose
    see_through = color[3] < SEE_THROUGH_BELOW
    mode = rr.components.FillMode.TransparentFillMajorWireframe if see_through else rr.components.FillMode.Solid
    place: dict[str, Any] = {"centers": [pose.position], "quaternions": [rr.Quaternion(xyzw=pose.quaternion)]}
    look: dict[str, Any] = {"colors": [color], "fill_mode": mode}
    match shape:
        case Box():
            return rr.Boxes3D(sizes=[shape.size], **place, **look)
        case Cylinder():
            return rr.Cylinders3D(lengths=[shape.length], radii=[shape.radius], **place, **look)
        case Sphere():
            return rr.Ellipsoids3D(radii=[shape.radius], **place, **look)
        case Mesh():
            return _flat_shaded(shape, pose, color)


def _flat_shaded(mesh: Mesh, pose: Pose, color: tuple[float, float, float, float]) -> Any:
    """Return every triangle with its own corners, so that edges stay sharp."""
    import rerun as rr

    corners = pose.apply(mesh.vertices)[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3).astype(np.float32),
        triangle_indices=np.arange(corners.shape[0] * 3, dtype=np.uint32).reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0).astype(np.float32),
        albedo_factor=color,
    )
