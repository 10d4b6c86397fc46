"""The footprint of a base: the planar convex hull of all collision shapes fixed to it."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from bestman_bt.messages import Pose
from bestman_bt.messages.shapes import box_corners

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)


def outline(geometry: ET.Element | None) -> NDArray[np.float64]:
    """Return points whose hull is that of the shape, (N, 3) metres in its own frame."""
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        return np.zeros((0, 3))
    match shape.tag:
        case "box":
            return box_corners(np.array(shape.get("size", "").split(), dtype=float) / 2)
        case "cylinder":
            radius, length = float(shape.get("radius", "0")), float(shape.get("length", "0"))
            ring = np.column_stack([radius * np.cos(_CIRCLE), radius * np.sin(_CIRCLE)])
            return np.concatenate([np.column_stack([ring, np.full(16, z)]) for z in (-length / 2, length / 2)])
        case "sphere":
            radius = float(shape.get("radius", "0"))
            ring = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE), np.zeros(16)])
            return radius * np.concatenate([ring, ring[:, [0, 2, 1]], ring[:, [2, 0, 1]]])
        case "mesh":
            scale = np.array(shape.get("scale", "1 1 1").split(), dtype=float)
            scaled: NDArray[np.float64] = _mesh_corners(shape.get("filename", "")) * scale
            return scaled
    return np.zeros((0, 3))


@lru_cache(maxsize=256)
def _mesh_corners(filename: str) -> NDArray[np.float64]:
    import coal  # reads what collision worlds read, COLLADA among it

    vertices: NDArray[np.float64] = np.array(
        coal.MeshLoader(coal.NODE_TYPE.BV_OBBRSS).load(filename, np.ones(3)).vertices()
    )
    corners: NDArray[np.float64] = vertices[ConvexHull(vertices).vertices]
    return corners


def footprint(links: Iterable[ET.Element], base_from_link: dict[str, Pose]) -> tuple[tuple[float, float], ...]:
    """Return the convex outline of ``links``: corners (x, y) in the base frame, metres, counter-clockwise, rounded to
    0.1 mm."""
    clouds = [np.zeros((0, 2))]
    for link in links:
        pose = base_from_link[link.get("name", "")]
        for collision in link.findall("collision"):
            corners = pose.apply(origin_pose(collision).apply(outline(collision.find("geometry"))))
            clouds.append(corners[:, :2])
    corners = convex_hull(np.concatenate(clouds).round(4))
    return tuple((float(x), float(y)) for x, y in corners)


def convex_hull(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the corners (M, 2) of the convex hull of points (N, 2), counter-clockwise, without points on edges; for a
    line, its ends."""
    ordered = np.unique(points, axis=0)
    try:
        corners: NDArray[np.float64] = ordered[ConvexHull(ordered).vertices]
    except (QhullError, ValueError):  # all on one line, or none at all
        return ordered[:: max(1, len(ordered) - 1)]
    return corners


def origin_pose(element: ET.Element) -> Pose:
    """Return the pose of an element's ``<origin>``."""
    origin = element.find("origin")
    if origin is None:
        return Pose()
    xyz, rpy = (np.array(origin.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
    return Pose.from_xyz_rpy(xyz, rpy)
