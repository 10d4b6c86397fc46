"""Furniture and objects from their YAML: shapes, surfaces, models."""

from __future__ import annotations

import numpy as np

from bestman_bt.configuration import ConfigurationError, Document, Problem, check, find_data, read_document
from bestman_bt.messages import Box, Cylinder, Mesh, ObjectModel, PlacedShape, Pose, Shape
from bestman_bt.scene.scene import FurnitureModel, Surface
from bestman_bt.scene.scene_config import FurnitureFile, ObjectFile, ShapeConfig, TubeConfig

_SYMMETRY_ORDERS = {"none": 1, "half turns": 2, "quarter turns": 4, "any": 0}


def read_furniture(name: str, asked_by: Problem | None = None) -> FurnitureModel:
    """The furniture of a shipped name or a file; raises ConfigurationError."""
    path = find_data("furniture", name, asked_by)
    document = read_document(path)
    file = check(document, FurnitureFile)
    return FurnitureModel(
        name=path.stem,
        footprint=file.footprint,
        parts=_placed(file.parts, document, "parts"),
        colors=tuple((*part.color, 1.0) for part in file.parts),
        surfaces=tuple(Surface(key, Pose.from_xyz_rpy(s.xyz), s.size) for key, s in file.surfaces.items()),
        friction=file.friction,
    )


def read_object(name: str, asked_by: Problem | None = None) -> ObjectModel:
    """The object of a shipped name or a file; raises ConfigurationError."""
    path = find_data("object", name, asked_by)
    document = read_document(path)
    file = check(document, ObjectFile)
    if not file.collision:
        raise ConfigurationError([document.problem(("collision",), "an object needs at least one shape")])
    return ObjectModel(
        name=path.stem,
        color=file.color,
        mass=file.mass,
        friction=file.friction,
        collision=_placed(file.collision, document, "collision"),
        visual=_placed(file.visual, document, "visual"),
        symmetry_order=_SYMMETRY_ORDERS[file.symmetry],
    )


def _placed(configs: tuple[ShapeConfig, ...], document: Document, field: str) -> tuple[PlacedShape, ...]:
    shapes = []
    for index, config in enumerate(configs):
        given = [name for name in ("box", "cylinder", "tube") if getattr(config, name) is not None]
        if len(given) != 1:
            message = f"one of box, cylinder and tube should be given, got {', '.join(given) or 'none'}"
            raise ConfigurationError([document.problem((field, index), message)])
        shapes.append(PlacedShape(_shape(config), Pose.from_xyz_rpy(config.xyz, config.rpy)))
    return tuple(shapes)


def _shape(config: ShapeConfig) -> Shape:
    if config.box is not None:
        return Box(config.box)
    if config.cylinder is not None:
        return Cylinder(*config.cylinder)
    assert config.tube is not None
    return tube_mesh(config.tube)


def tube_mesh(tube: TubeConfig, segments: int = 40) -> Mesh:
    """A vessel open at the top, centred on its bounding box, z up; faces turn outwards, the inside included."""
    angles = np.linspace(0.0, 2.0 * np.pi, segments, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    top, bottom, inner = tube.length / 2, -tube.length / 2, tube.radius - tube.wall
    profile = [(tube.radius, bottom), (tube.radius, top), (inner, top), (inner, bottom + tube.bottom)]
    rings = [np.column_stack([radius * ring, np.full(segments, z)]) for radius, z in profile]
    centres = np.array([[0.0, 0.0, bottom], [0.0, 0.0, bottom + tube.bottom]])
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
