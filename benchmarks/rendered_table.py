"""Rendered table scenes with known truth: what the perception benchmark and the perception tests look at.

A table top with objects or, as a counter, with a wall behind it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.rendering import Color, DepthNoise, render_view
from bestman_bt.messages import Box, Cylinder, Mesh, ObjectModel, PlacedShape, Pose, Sphere
from bestman_bt.perception.segmentation.base import Region
from bestman_bt.perception.view import View


@dataclass(frozen=True, eq=False)
class TrueObject:
    """An object of the scene; ``known``: whether the detector is given its model. ``yaw``: radians."""

    model: ObjectModel
    pose: Pose
    known: bool


@dataclass(frozen=True, eq=False)
class RenderedTable:
    """A view, the region a map would give (off by up to 3 cm and 2°), and the truth, all in one z-up frame.

    ``table``: pose of the centre of the top; its front edge is at x = -``size[0]`` / 2.
    """

    view: View
    region: Region
    objects: tuple[TrueObject, ...]
    table: Pose
    size: tuple[float, float]


def tumbler(radius: float = 0.033, height: float = 0.10, wall: float = 0.003, sides: int = 40) -> Mesh:
    """An open cup without a handle: outer and inner wall, rim, bottom; metres, centred."""
    angles = np.arange(sides) * (2 * math.pi / sides)
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    half = height / 2
    rings = [(radius, -half), (radius, half), (radius - wall, half), (radius - wall, -half + wall)]
    vertices = [np.column_stack([circle * r, np.full(sides, z)]) for r, z in rings]
    vertices += [np.array([[0.0, 0.0, -half], [0.0, 0.0, -half + wall]])]
    bottom, floor = 4 * sides, 4 * sides + 1
    faces = []
    for i in range(sides):
        j = (i + 1) % sides
        for lower in (0, 1, 2):
            a, b, c, d = (lower * sides + i, lower * sides + j, (lower + 1) * sides + j, (lower + 1) * sides + i)
            faces += [[a, b, c], [a, c, d]]
        faces += [[bottom, j, i], [floor, 3 * sides + i, 3 * sides + j]]
    return Mesh(np.concatenate(vertices), np.array(faces))


def solid(name: str, shape: Box | Cylinder | Sphere, color: tuple[float, float, float], symmetry: int) -> ObjectModel:
    """A model of one shape."""
    return ObjectModel(name, color, 0.2, 0.8, (PlacedShape(shape, Pose()),), symmetry_order=symmetry)


def known_models(palette: int = 0) -> tuple[ObjectModel, ...]:
    """Cup, can, box, tin and cube; palettes change the colours, in the last one all look alike."""
    colors = [
        [(0.9, 0.88, 0.82), (0.2, 0.4, 0.8), (0.8, 0.2, 0.2), (0.3, 0.7, 0.4), (0.9, 0.8, 0.2)],
        [(0.85, 0.45, 0.15), (0.75, 0.15, 0.15), (0.9, 0.75, 0.2), (0.5, 0.3, 0.6), (0.2, 0.6, 0.7)],
        [(0.15, 0.55, 0.35), (0.7, 0.7, 0.72), (0.25, 0.35, 0.65), (0.8, 0.5, 0.5), (0.4, 0.3, 0.2)],
        [(0.6, 0.6, 0.6)] * 5,
    ][palette % 4]
    cup = ObjectModel(
        "cup",
        colors[0],
        0.15,
        0.8,
        (PlacedShape(Cylinder(0.033, 0.10), Pose()),),
        (PlacedShape(tumbler(), Pose()),),
        symmetry_order=0,
    )
    return (
        cup,
        solid("can", Cylinder(0.033, 0.10), colors[1], 0),
        solid("box", Box((0.04, 0.06, 0.10)), colors[2], 2),
        solid("tin", Box((0.055, 0.10, 0.08)), colors[3], 2),
        solid("cube", Box((0.05, 0.05, 0.05)), colors[4], 4),
    )


def unknown_model(rng: np.random.Generator, known: Sequence[ObjectModel], lookalike: bool = False) -> ObjectModel:
    """A box or cylinder of another size (by 12 mm or more) than every known model; a lookalike is nearly as large."""
    while True:
        other = known[int(rng.integers(len(known)))]
        if lookalike:
            color = other.color
            x, y, z = (float(extent) for extent in other.size + rng.uniform(-0.025, 0.025, 3))
        else:
            color = (float(rng.uniform(0.1, 0.95)), float(rng.uniform(0.1, 0.95)), float(rng.uniform(0.1, 0.95)))
            x, y, z = (float(v) for v in rng.uniform([0.03, 0.03, 0.04], [0.09, 0.12, 0.16]))
        if rng.random() < 0.7:
            model = solid("unknown", Box((x, y, z)), color, 2)
        else:
            model = solid("unknown", Cylinder(x * 0.5, z), color, 0)
        if all(_distinct(model, other) for other in known):
            return model


def _distinct(a: ObjectModel, b: ObjectModel) -> bool:
    size_a, size_b = a.size, b.size
    sides = np.abs(np.sort(size_a[:2]) - np.sort(size_b[:2])).max()
    return bool(max(sides, abs(size_a[2] - size_b[2])) > 0.012)


def random_table(
    seed: int,
    known: int = 3,
    unknown: int = 2,
    palette: int | None = None,
    counter: bool | None = None,
    lookalikes: bool = False,
    models: tuple[ObjectModel, ...] | None = None,
    noise: DepthNoise | None = None,
) -> RenderedTable:
    """A table or counter with up to ``known`` known and ``unknown`` unknown objects, at least 2 cm apart.

    ``models``: the known ones, in place of ``known_models``. ``lookalikes``: unknown objects have the colour of a
    known one, and are at most 25 mm larger or smaller, at least 12 mm.
    """
    rng = np.random.default_rng(seed)
    models = models or known_models(int(rng.integers(4)) if palette is None else palette)
    counter = bool(rng.random() < 0.5) if counter is None else counter
    size = (0.6, 1.2) if counter else (0.8, 1.2)
    top = 0.9 if counter else 0.75
    table = Pose.from_xyz_rpy(
        (0.30 + rng.uniform(0.0, 0.12) + size[0] / 2, rng.uniform(-0.1, 0.1), top), (0, 0, rng.uniform(-0.06, 0.06))
    )
    chosen = list(rng.permutation(len(models))[:known])
    wanted = [(models[i], True) for i in chosen] + [
        (unknown_model(rng, models, lookalikes), False) for _ in range(unknown)
    ]
    placed: list[TrueObject] = []
    for model, is_known in wanted:
        reach = float(np.hypot(*model.size[:2])) / 2
        for _ in range(100):
            x, y = rng.uniform([-size[0] / 2 + 0.08, -0.35], [min(size[0] / 2 - 0.08, 0.15), 0.35])
            if all(
                math.dist((x, y), table.inverse().apply(other.pose.position)[:2])
                > reach + 0.02 + float(np.hypot(*other.model.size[:2])) / 2
                for other in placed
            ):
                pose = table @ Pose.from_xyz_rpy((x, y, model.size[2] / 2), (0, 0, rng.uniform(-math.pi, math.pi)))
                placed.append(TrueObject(model, pose, is_known))
                break
    return render_table(placed, table, size, rng, counter, noise)


def render_table(
    objects: Sequence[TrueObject],
    table: Pose,
    size: tuple[float, float],
    rng: np.random.Generator,
    wall_behind: bool = False,
    noise: DepthNoise | None = None,
    frame_from_camera: Pose | None = None,
) -> RenderedTable:
    """Render ``objects`` on the table; else the camera hangs on a mast above the robot's base, 40 to 50° down."""
    if frame_from_camera is None:
        frame_from_camera = mast_camera(math.radians(rng.uniform(40.0, 50.0)), rng.uniform(-0.15, 0.15))
    depth_of_body = float(table.position[2]) if wall_behind else 0.03
    slab = table @ Pose.from_xyz_rpy((0.0, 0.0, -depth_of_body / 2))
    parts: list[tuple[PlacedShape, Color]] = [
        (PlacedShape(Box((6.0, 6.0, 0.02)), Pose.from_xyz_rpy((2.0, 0.0, -0.01))), (0.55, 0.52, 0.5)),
        (PlacedShape(Box((*size, depth_of_body)), slab), (0.75, 0.6, 0.42)),
    ]
    if wall_behind:
        wall = table @ Pose.from_xyz_rpy((size[0] / 2 + 0.06, 0.0, 0.3))
        parts.append((PlacedShape(Box((0.1, 4.0, 1.8)), wall), (0.85, 0.85, 0.8)))
    for item in objects:
        parts += colored_parts(item.model, item.pose)
    view = render_view(parts, frame_from_camera, rng, noise)
    believed = table @ Pose.from_xyz_rpy(
        rng.uniform([-0.03, -0.03, 0], [0.03, 0.03, 0]), (0, 0, rng.uniform(-1, 1) * 0.035)
    )
    region = Region(believed, (size[0] + 0.1, size[1] + 0.1))
    return RenderedTable(view, region, tuple(objects), table, size)


def colored_parts(model: ObjectModel, frame_from_object: Pose) -> list[tuple[PlacedShape, Color]]:
    """What a camera sees of an object at that pose."""
    shapes = model.visual or model.collision
    colors = model.visual_colors or (model.color,) * len(shapes)
    return [
        (PlacedShape(part.shape, frame_from_object @ part.pose), color)
        for part, color in zip(shapes, colors, strict=True)
    ]


def recolored(model: ObjectModel, color: tuple[float, float, float]) -> ObjectModel:
    """The same model in another colour."""
    return replace(model, color=color)


def mast_camera(pitch: float, yaw: float) -> Pose:
    """Above the robot's base, looking ahead and ``pitch`` radians down."""
    mast_from_camera = Pose.from_matrix(
        np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    )
    return Pose.from_xyz_rpy((-0.2, 0.0, 1.65), (0.0, pitch, yaw)) @ mast_from_camera
