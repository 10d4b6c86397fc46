"""Furniture from its YAML: solid parts and surfaces to put things on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bestman_bt.configuration import Problem, check, find_data, read_document
from bestman_bt.configuration.quantity import Friction, Lengths3, Size2
from bestman_bt.messages import Pose
from bestman_bt.scene.scene import FurnitureModel, Surface
from bestman_bt.scene.shape_file import ShapeConfig, placed_shapes

DEFAULT_COLOR = (0.7, 0.7, 0.7)


@dataclass(frozen=True)
class SurfaceConfig:
    """A horizontal rectangle centred at ``xyz`` in the furniture frame."""

    xyz: Lengths3
    size: Size2


@dataclass(frozen=True)
class FurnitureFile:
    """A piece of furniture; its frame is on the floor in the middle of the footprint, the front faces -x."""

    footprint: Size2
    parts: tuple[ShapeConfig, ...]
    surfaces: Mapping[str, SurfaceConfig] = field(default_factory=dict)
    friction: Friction = 0.8
    description: str = ""


def read_furniture(name: str, asked_by: Problem | None = None) -> FurnitureModel:
    """The furniture of a shipped name or a file; raises ConfigurationError."""
    path = find_data("furniture", name, asked_by)
    document = read_document(path)
    file = check(document, FurnitureFile)
    return FurnitureModel(
        name=path.stem,
        footprint=file.footprint,
        parts=placed_shapes(file.parts, document, "parts"),
        colors=tuple((*(part.color or DEFAULT_COLOR), 1.0) for part in file.parts),
        surfaces=tuple(Surface(key, Pose.from_xyz_rpy(s.xyz), s.size) for key, s in file.surfaces.items()),
        friction=file.friction,
    )
