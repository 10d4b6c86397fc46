"""Bodies of the scene: solid shapes on frames of their own."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Sphere
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.snapshot import RecordedBody

if TYPE_CHECKING:
    import rerun as rr

SEE_THROUGH_BELOW = 0.99
FLOOR_COLOR = (0.5, 0.52, 0.56, 1.0)
FLOOR_MARGIN, FLOOR_THICKNESS = 0.2, 0.02
FLOOR_GAP = 0.002
"""Metres below z = 0, so that marks on the floor are not swallowed."""
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def body_frame(name: str) -> str:
    """The coordinate frame of a body."""
    return f"body/{name}"


def write_body(recording: rr.RecordingStream, body: RecordedBody) -> None:
    """Write the shapes of a body in its frame; its pose is a transform of its own."""
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
    """The bounding box of bodies in the map frame: (2, 3) metres; (2, 3) zeros for none."""
    corners = [body.pose.apply(placed.pose.apply(_corners(placed))) for body in bodies for placed in body.shapes]
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
    """Every triangle with its own corners, so that edges stay sharp."""
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


def _corners(placed: PlacedShape) -> NDArray[np.float64]:
    shape = placed.shape
    match shape:
        case Box():
            half = np.array(shape.size) / 2
        case Cylinder():
            half = np.array([shape.radius, shape.radius, shape.length / 2])
        case Sphere():
            half = np.full(3, shape.radius)
        case Mesh():
            return shape.vertices
    corners: NDArray[np.float64] = CORNERS * half
    return corners
