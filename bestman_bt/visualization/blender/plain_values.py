"""Shapes and poses as plain values, for the file that Blender reads."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Shape, Sphere


def shape_document(shape: Shape) -> dict[str, Any]:
    """A shape as plain values; metres."""
    match shape:
        case Box():
            return {"kind": "box", "size": list(shape.size)}
        case Cylinder():
            return {"kind": "cylinder", "radius": shape.radius, "length": shape.length}
        case Sphere():
            return {"kind": "sphere", "radius": shape.radius}
        case Mesh():
            return {"kind": "mesh", "vertices": shape.vertices.tolist(), "faces": shape.faces.tolist()}


def pose_document(pose: Pose) -> list[float]:
    """Position and quaternion xyzw in one list."""
    return [*map(float, pose.position), *map(float, pose.quaternion)]


def placed_document(placed: PlacedShape, color: Sequence[float] | None) -> dict[str, Any]:
    """A shape with its place and rgba; without a colour it keeps that of its file."""
    return {
        "shape": shape_document(placed.shape),
        "pose": pose_document(placed.pose),
        "color": None if color is None else list(color),
    }
