"""Shapes as furniture and object files write them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.configuration import ConfigurationError, Document
from bestman_bt.configuration.quantity import Angles3, Color, Lengths3, PositiveLength, Size2, Size3
from bestman_bt.messages import Box, Cylinder, Mesh, PlacedShape, Pose, Shape


@dataclass(frozen=True)
class TubeConfig:
    """A straight vessel, open at the top: outer radius, height, thickness of wall and bottom."""

    radius: PositiveLength
    length: PositiveLength
    wall: PositiveLength
    bottom: PositiveLength


@dataclass(frozen=True)
class ShapeConfig:
    """One of ``box`` (extents), ``cylinder`` (radius, length, along z) and ``tube``, centred at ``xyz``."""

    box: Size3 | None = None
    cylinder: Size2 | None = None
    tube: TubeConfig | None = None
    xyz: Lengths3 = (0.0, 0.0, 0.0)
    rpy: Angles3 = (0.0, 0.0, 0.0)
    color: Color = (0.7, 0.7, 0.7)


def placed_shapes(configs: tuple[ShapeConfig, ...], document: Document, field: str) -> tuple[PlacedShape, ...]:
    """The shapes of a list in a file, each at its place; raises ConfigurationError."""
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
