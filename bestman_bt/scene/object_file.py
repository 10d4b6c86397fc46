"""Movable objects from their YAML."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from bestman_bt.configuration import ConfigurationError, Problem, check, find_data, read_document
from bestman_bt.configuration.quantity import Color, Friction, Mass
from bestman_bt.messages import ObjectModel
from bestman_bt.scene.shape_file import ShapeConfig, placed_shapes

_SYMMETRY_ORDERS = {"none": 1, "half turns": 2, "quarter turns": 4, "any": 0}


@dataclass(frozen=True)
class ObjectFile:
    """A movable object; its frame is in the middle of its bounding box. ``symmetry``: turns about z that look alike."""

    mass: Mass
    color: Color
    collision: tuple[ShapeConfig, ...]
    visual: tuple[ShapeConfig, ...] = ()
    friction: Friction = 0.8
    symmetry: Literal["none", "half turns", "quarter turns", "any"] = "none"
    description: str = ""


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
        collision=placed_shapes(file.collision, document, "collision"),
        visual=placed_shapes(file.visual, document, "visual"),
        symmetry_order=_SYMMETRY_ORDERS[file.symmetry],
    )
