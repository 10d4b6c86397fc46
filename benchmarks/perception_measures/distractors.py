"""Things that are no handles but look a little like them: what stands, hangs and lies before walls and fronts."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from benchmarks.rendering import Color
from bestman_bt.messages import Box, Cylinder, PlacedShape, Pose, Sphere

Parts = list[tuple[PlacedShape, Color]]


def block(low: tuple[float, float, float], high: tuple[float, float, float], color: Color) -> Parts:
    """A box between two corners."""
    lower, upper = np.array(low), np.array(high)
    x, y, z = (float(extent) for extent in upper - lower)
    return [(PlacedShape(Box((x, y, z)), Pose((lower + upper) / 2)), color)]


def moved(parts: Parts, pose: Pose) -> Parts:
    """The same parts, placed by ``pose``."""
    return [(PlacedShape(part.shape, pose @ part.pose), color) for part, color in parts]


def some_color(rng: np.random.Generator) -> Color:
    """Any colour but black."""
    red, green, blue = (float(value) for value in rng.uniform(0.1, 0.95, 3))
    return red, green, blue


def standing_object(rng: np.random.Generator) -> Parts:
    """A bottle, can, carton or ball, its foot at the origin."""
    color = some_color(rng)
    match int(rng.integers(4)):
        case 0:
            radius, height = rng.uniform(0.025, 0.045), rng.uniform(0.12, 0.22)
            neck = PlacedShape(Cylinder(0.013, 0.09), Pose(np.array([0.0, 0.0, height + 0.03])))
            return [
                (PlacedShape(Cylinder(radius, height), Pose(np.array([0.0, 0.0, height / 2]))), color),
                (neck, color),
            ]
        case 1:
            radius, height = rng.uniform(0.025, 0.04), rng.uniform(0.08, 0.15)
            return [(PlacedShape(Cylinder(radius, height), Pose(np.array([0.0, 0.0, height / 2]))), color)]
        case 2:
            x, y, z = (float(extent) for extent in rng.uniform([0.03, 0.04, 0.06], [0.12, 0.2, 0.3]))
            return [(PlacedShape(Box((x, y, z)), Pose(np.array([0.0, 0.0, z / 2]))), color)]
    radius = float(rng.uniform(0.02, 0.06))
    return [(PlacedShape(Sphere(radius), Pose(np.array([0.0, 0.0, radius]))), color)]


def row_of_objects(
    rng: np.random.Generator, count: int, x: tuple[float, float], y: tuple[float, float], z: float
) -> Parts:
    """Objects that stand at height ``z``, their middles within the limits."""
    parts: Parts = []
    for _ in range(count):
        pose = Pose.from_xyz_rpy((rng.uniform(*x), rng.uniform(*y), z), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))
        parts += moved(standing_object(rng), pose)
    return parts


def chair(rng: np.random.Generator) -> Parts:
    """Four legs, a seat, a back with bars; on the floor at the origin, its back towards -x."""
    color, leg = some_color(rng), float(rng.uniform(0.02, 0.045))
    width, height = float(rng.uniform(0.36, 0.44)), float(rng.uniform(0.42, 0.48))
    half = width / 2
    parts = block((-half, -half, height - 0.03), (half, half, height), color)
    for x in (-half, half - leg):
        for y in (-half, half - leg):
            top = 0.9 if x < 0 else height - 0.03
            parts += block((x, y, 0.0), (x + leg, y + leg, top), color)
    for z in (0.62, 0.74, 0.86):
        parts += block((-half, -half + leg, z), (-half + 0.015, half - leg, z + 0.04), color)
    return parts


def table(rng: np.random.Generator, width: float, depth: float, height: float) -> Parts:
    """A top on four legs, the middle of its footprint at the origin."""
    color, leg = some_color(rng), float(rng.uniform(0.03, 0.07))
    x, y = depth / 2, width / 2
    parts = block((-x, -y, height - 0.03), (x, y, height), color)
    for left in (-x, x - leg):
        for right in (-y, y - leg):
            parts += block((left, right, 0.0), (left + leg, right + leg, height - 0.03), color)
    return parts


def towel(rng: np.random.Generator, near: float) -> Parts:
    """A hanging cloth, ``near`` metres before the plane x = 0, its upper border at the origin."""
    width, height = float(rng.uniform(0.12, 0.35)), float(rng.uniform(0.25, 0.5))
    thick = float(rng.uniform(0.006, 0.012))
    return block((-near - thick, -width / 2, -height), (-near, width / 2, 0.0), some_color(rng))


def picture_frame(rng: np.random.Generator) -> Parts:
    """Four strips around a picture on the plane x = 0."""
    half_y, half_z = (float(extent) for extent in rng.uniform([0.12, 0.12], [0.35, 0.3]))
    strip, thick, color = float(rng.uniform(0.015, 0.03)), float(rng.uniform(0.012, 0.03)), some_color(rng)
    parts = block((-0.004, -half_y, -half_z), (0.0, half_y, half_z), some_color(rng))
    for side in (-1.0, 1.0):
        y, z = side * (half_y - strip / 2), side * (half_z - strip / 2)
        parts += block((-thick, y - strip / 2, -half_z), (0.0, y + strip / 2, half_z), color)
        parts += block((-thick, -half_y, z - strip / 2), (0.0, half_y, z + strip / 2), color)
    return parts


def bookshelf(rng: np.random.Generator) -> Parts:
    """Open boards with a back, things on them; its front at x = 0, its foot at the origin."""
    width, depth, height = (float(v) for v in rng.uniform([0.6, 0.2, 0.9], [1.0, 0.4, 1.8]))
    color, back, thick = some_color(rng), some_color(rng), 0.02
    parts = block((depth - 0.01, -width / 2, 0.0), (depth, width / 2, height), back)
    for y in (-width / 2, width / 2 - thick):
        parts += block((0.0, y, 0.0), (depth, y + thick, height), color)
    for z in np.linspace(0.05, height - thick, int(rng.integers(3, 6))):
        parts += block((0.0, -width / 2, float(z)), (depth, width / 2, float(z) + thick), color)
        reach = (float(rng.uniform(0.05, depth - 0.08)), depth - 0.06)
        parts += row_of_objects(
            rng, int(rng.integers(0, 5)), reach, (-width / 2 + 0.1, width / 2 - 0.1), float(z) + thick
        )
    return parts


def cartons(rng: np.random.Generator) -> Parts:
    """Boxes on and beside each other, some with a smaller one on top; fronts near x = 0."""
    parts: Parts = []
    y = -0.6
    while y < 0.6:
        z, near = 0.0, float(rng.uniform(-0.06, 0.06))
        width = float(rng.uniform(0.2, 0.5))
        for _ in range(int(rng.integers(1, 4))):
            height, shift = float(rng.uniform(0.12, 0.4)), float(rng.uniform(-0.03, 0.03))
            parts += block((near + shift, y, z), (near + 0.4, y + width, z + height), some_color(rng))
            z += height
        y += width + float(rng.uniform(0.0, 0.05))
    return parts


def plain_sideboard(rng: np.random.Generator) -> Parts:
    """Fronts that open by a push: gaps, framed panels or an overhanging top, but no handles; its front at x = 0."""
    width, depth, height = (float(v) for v in rng.uniform([0.6, 0.35, 0.5], [1.2, 0.5, 1.0]))
    front, body, gap = some_color(rng), some_color(rng), 0.003
    over, columns, rows = float(rng.uniform(0.0, 0.03)), int(rng.integers(1, 4)), int(rng.integers(1, 4))
    framed = bool(rng.random() < 0.5)
    parts = block((0.02, -width / 2, 0.0), (depth, width / 2, height), body)
    parts += block((-over, -width / 2 - over, height), (depth, width / 2 + over, height + 0.025), body)
    w, h = width / columns, (height - 0.06) / rows
    for i in range(columns):
        for j in range(rows):
            y, z = -width / 2 + i * w, 0.06 + j * h
            parts += block((0.0, y + gap, z + gap), (0.02, y + w - gap, z + h - gap), front)
            if framed and min(w, h) > 0.2:
                for side in (0, 1):
                    left, low = y + gap + side * (w - 2 * gap - 0.05), z + gap + side * (h - 2 * gap - 0.05)
                    parts += block((-0.006, left, z + gap), (0.0, left + 0.05, z + h - gap), front)
                    parts += block((-0.006, y + gap, low), (0.0, y + w - gap, low + 0.05), front)
    return parts


HANDLELESS: tuple[Callable[[np.random.Generator], Parts], ...] = (bookshelf, cartons, plain_sideboard)
