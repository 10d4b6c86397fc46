"""Meshes of generated shapes (vessels, bodies of revolution, bent bars) and the convex parts that they consist of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from bestman_bt.messages import Mesh

SIDES = 48
"""Sides of a generated body of revolution."""
RING_PARTS = 16
"""Convex parts around an open vessel; divides SIDES. Their flat insides reach 2 % of the radius into its hollow."""

Row = tuple[float, float, float]
"""Height, inner and outer radius of a level of a body of revolution, metres."""


def tube_mesh(radius: float, length: float, wall: float, bottom: float, segments: int = 40) -> Mesh:
    """Return a vessel open at the top, centred on its bounding box, z up; faces turn outwards, the inside included."""
    angles = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    half, inner = length / 2, radius - wall
    profile = [(radius, -half), (radius, half), (inner, half), (inner, bottom - half)]
    rings = [np.column_stack([r * ring, np.full(segments, z)]) for r, z in profile]
    centres = np.array([[0.0, 0.0, -half], [0.0, 0.0, bottom - half]])
    faces = []
    for i in range(segments):
        j = (i + 1) % segments
        for lower in range(len(profile) - 1):
            a, b = lower * segments + i, lower * segments + j
            c, d = (lower + 1) * segments + j, (lower + 1) * segments + i
            faces += [(a, b, c), (a, c, d)]
        outside, inside = len(profile) * segments, len(profile) * segments + 1
        faces.append((outside, j, i))
        faces.append((inside, 3 * segments + i, 3 * segments + j))
    return Mesh(np.concatenate([*rings, centres]), np.array(faces))


def revolved_mesh(profile: Sequence[tuple[float, float]]) -> Mesh:
    """Return the surface of a body of revolution about z; ``profile``: (radius, z), both ends on the axis, outside on
    its right.
    """
    from trimesh.creation import revolve  # takes a quarter of a second to import

    body = revolve(np.array(profile), sections=SIDES)
    return Mesh(body.vertices, body.faces)


def revolved_parts(profile: Sequence[tuple[float, float]]) -> tuple[Mesh, ...]:
    """Return convex parts that fill the body of ``revolved_mesh``, without its hollows.

    The profile is cut at the heights of its corners; levels that together stay convex are one part, and a level that
    does not reach the axis is a ring of ``RING_PARTS`` parts, which overlap.
    """
    parts: list[Mesh] = []
    for stack in _convex_stacks(_levels(profile)):
        rows = np.array(stack)
        if rows[:, 1].max() < 1e-9:
            circle = _circle(SIDES)
            parts.append(
                convex_hull(np.concatenate([np.column_stack([r * circle, z + 0 * circle[:, 0]]) for z, _, r in rows]))
            )
            continue
        parts += [_ring_part(rows, part) for part in range(RING_PARTS)]
    return tuple(parts)


def _ring_part(rows: NDArray[np.float64], part: int) -> Mesh:
    """Return one of the parts around a ring of ``rows`` (N, 3), see Row; it reaches one side far into its neighbours'
    walls.

    If parts only touched, a slightly compliant finger would be caught between the adjoining sides.
    """
    step = SIDES // RING_PARTS
    circle = _circle(SIDES)
    outside = circle[np.arange(part * step - 1, (part + 1) * step + 2) % SIDES]
    first, last = circle[part * step], circle[(part + 1) * step % SIDES]
    along = (last - first) / np.linalg.norm(last - first)
    side = 2.0 * math.sin(math.pi / SIDES)
    points = []
    for z, inner, outer in rows:
        # The flat inside goes straight on into the wall, at most to its middle.
        further = min(inner * side, (outer - inner) / (2.0 * math.sin(math.pi / RING_PARTS))) * along
        inside = np.array([inner * first - further, inner * last + further])
        points += [np.column_stack([ring, np.full(len(ring), z)]) for ring in (inside, outer * outside)]
    return convex_hull(np.concatenate(points))


def bent_bar(radius: float, bar: float, start: float, sweep: float, sides: int = 12) -> tuple[Mesh, tuple[Mesh, ...]]:
    """Return a round bar bent along an arc in the xz plane, closed at its ends, and its convex parts.

    ``radius``: of the arc about the origin, ``bar``: of the bar, metres. ``start``: radians from x towards z.
    """
    steps = max(2, math.ceil(abs(sweep) / math.radians(22.5)))
    section = _circle(sides) * bar
    rings = []
    for angle in start + np.linspace(0.0, sweep, steps + 1):
        outward = np.array([math.cos(angle), 0.0, math.sin(angle)])
        rings.append(outward * (radius + section[:, :1]) + np.array([0.0, 1.0, 0.0]) * section[:, 1:])
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        for k in range(steps):
            a, b, c, d = k * sides + i, k * sides + j, (k + 1) * sides + j, (k + 1) * sides + i
            faces += [(a, b, c), (a, c, d)]
        if 1 <= i < sides - 1:
            faces += [(0, j, i), (steps * sides, steps * sides + i, steps * sides + j)]
    corners = np.array(faces)
    mesh = Mesh(np.concatenate(rings), corners if sweep > 0 else corners[:, ::-1])
    return mesh, tuple(convex_hull(np.concatenate(rings[k : k + 2])) for k in range(steps))


def convex_hull(points: NDArray[np.float64]) -> Mesh:
    """Return the convex hull of (N, 3) points, faces outwards. Raises scipy's QhullError for flat points."""
    hull = ConvexHull(points)
    a, b, c = (points[hull.simplices[:, k]] for k in range(3))
    inwards = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    used, renumbered = np.unique(faces, return_inverse=True)
    return Mesh(points[used], renumbered.reshape(faces.shape))


def _circle(sides: int) -> NDArray[np.float64]:
    angles = np.arange(sides) * (2 * math.pi / sides)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _levels(profile: Sequence[tuple[float, float]]) -> list[list[tuple[Row, Row]]]:
    """Return, between each two heights of corners, from the bottom up, the trapezoids (lower row, upper row) of the
    profile.
    """
    heights = sorted({round(z, 9) for _, z in profile})
    edges = list(zip(profile, [*profile[1:], profile[0]], strict=True))
    levels = []
    for lower, upper in pairwise(heights):
        middle = (lower + upper) / 2
        crossing = [edge for edge in edges if min(edge[0][1], edge[1][1]) < middle < max(edge[0][1], edge[1][1])]
        crossing.sort(key=lambda edge: _radius(edge, middle))
        pairs = zip(crossing[::2], crossing[1::2], strict=True)
        levels.append(
            [
                ((lower, _radius(i, lower), _radius(o, lower)), (upper, _radius(i, upper), _radius(o, upper)))
                for i, o in pairs
            ]
        )
    return levels


def _radius(edge: tuple[tuple[float, float], tuple[float, float]], z: float) -> float:
    (r0, z0), (r1, z1) = edge
    return r0 + (r1 - r0) * (z - z0) / (z1 - z0)


def _convex_stacks(levels: list[list[tuple[Row, Row]]]) -> list[list[Row]]:
    """Join trapezoids upwards as long as they continue each other and stay convex."""
    done: list[list[Row]] = []
    growing: list[list[Row]] = []
    for level in levels:
        grown: list[list[Row]] = []
        for lower, upper in level:
            below = next((stack for stack in growing if _continues(stack, lower, upper)), None)
            if below is None:
                grown.append([lower, upper])
            else:
                growing.remove(below)
                grown.append([*below, upper])
        done += growing
        growing = grown
    return done + growing


def _continues(stack: list[Row], lower: Row, upper: Row) -> bool:
    before, top = stack[-2:]
    if max(abs(a - b) for a, b in zip(top, lower, strict=True)) > 1e-9:
        return False
    inner, outer = (
        (upper[k] - top[k]) / (upper[0] - top[0]) - (top[k] - before[k]) / (top[0] - before[0]) for k in (1, 2)
    )
    return inner >= -1e-9 and outer <= 1e-9
