"""Distances and cuts of convex polygons and segments in the plane."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bestman_bt.messages import Pose2D
from bestman_bt.scene.scene import Wall, wall_box

Points = NDArray[np.float64]


def rectangle(pose: Pose2D, size: tuple[float, float]) -> Points:
    """Return the corners (4, 2), metres, of a rectangle centred at ``pose``, counter-clockwise."""
    x, y = size[0] / 2, size[1] / 2
    return pose.apply(np.array([[-x, -y], [x, -y], [x, y], [-x, y]]))


def wall_rectangle(wall: Wall) -> Points:
    """Return the corners (4, 2) of a wall in top view, counter-clockwise."""
    box, pose = wall_box(wall)
    return rectangle(pose.to_pose2d(), box.size[:2])


def depth_inside(polygon: Points, point: Points) -> float:
    """Return the distance of a point to the nearest edge line of a convex counter-clockwise polygon; negative
    outside."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    offsets = point - polygon
    cross = edges[:, 0] * offsets[:, 1] - edges[:, 1] * offsets[:, 0]
    return float(np.min(cross / np.linalg.norm(edges, axis=1)))


def distance_to_polygon(polygon: Points, point: Points) -> float:
    """Return the distance of a point to a convex counter-clockwise polygon, metres; 0 inside."""
    if depth_inside(polygon, point) >= 0.0:
        return 0.0
    edges = np.roll(polygon, -1, axis=0) - polygon
    along = np.einsum("ij,ij->i", point - polygon, edges) / np.einsum("ij,ij->i", edges, edges)
    nearest = polygon + np.clip(along, 0.0, 1.0)[:, None] * edges
    return float(np.min(np.linalg.norm(nearest - point, axis=1)))


def overlap_depth(a: Points, b: Points) -> float:
    """Return the distance that separates two convex counter-clockwise polygons; 0 if they do not overlap."""
    depth = math.inf
    for polygon in (a, b):
        edges = np.roll(polygon, -1, axis=0) - polygon
        normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1, keepdims=True)
        along_a, along_b = a @ normals.T, b @ normals.T
        over = np.minimum(along_a.max(axis=0) - along_b.min(axis=0), along_b.max(axis=0) - along_a.min(axis=0))
        depth = min(depth, float(over.min()))
        if depth <= 0.0:
            return 0.0
    return depth


def polygons_overlap(a: Points, b: Points) -> bool:
    """Return whether two convex counter-clockwise polygons share an area."""
    return overlap_depth(a, b) > 0.0


def segment_outside(segment: Points, polygon: Points, tolerance: float = 1e-6) -> list[Points]:
    """Return the parts of a segment (2, 2) outside a convex counter-clockwise polygon; its boundary is outside."""
    start, direction = segment[0], segment[1] - segment[0]
    enter, leave = 0.0, 1.0
    edges = np.roll(polygon, -1, axis=0) - polygon
    for corner, edge in zip(polygon, edges, strict=True):
        inward = np.array([-edge[1], edge[0]]) / np.linalg.norm(edge)
        depth, slope = float((start - corner) @ inward) - tolerance, float(direction @ inward)
        if abs(slope) < 1e-12:
            if depth < 0.0:
                return [segment]
        elif slope > 0.0:
            enter = max(enter, -depth / slope)
        else:
            leave = min(leave, -depth / slope)
    if enter >= leave:
        return [segment]
    ends = [(0.0, enter), (leave, 1.0)]
    length = float(np.linalg.norm(direction))
    return [start + np.array([[a], [b]]) * direction for a, b in ends if (b - a) * length > 10 * tolerance]
