"""Furniture from its YAML: written part by part, or generated from a few options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from bestman_bt.configuration import ConfigurationError, Document, Problem, check, find_data, read_document
from bestman_bt.configuration.quantity import Friction, Lengths3, Size2, WholeNumber
from bestman_bt.messages import Pose
from bestman_bt.scene.articulation_file import PART_COLOR, ArticulationConfig, read_articulations
from bestman_bt.scene.furniture_generator import FurnitureOptionError, generate_furniture, options_of
from bestman_bt.scene.scene import FurnitureModel, Surface
from bestman_bt.scene.shape_file import ShapeConfig, placed_shapes


@dataclass(frozen=True)
class SurfaceConfig:
    """A horizontal rectangle centred at ``xyz`` in the furniture frame."""

    xyz: Lengths3
    size: Size2


@dataclass(frozen=True)
class FurnitureFile:
    """A piece of furniture; its frame is on the floor in the middle of the footprint, the front faces -x.

    ``articulations``: doors and drawers.
    """

    footprint: Size2
    parts: tuple[ShapeConfig, ...]
    surfaces: Mapping[str, SurfaceConfig] = field(default_factory=dict)
    articulations: Mapping[str, ArticulationConfig] = field(default_factory=dict)
    friction: Friction = 0.8
    description: str = ""


@dataclass(frozen=True)
class GeneratedFurnitureFile:
    """Furniture that is made from options: ``generate`` holds its ``kind`` and what is to be so and not otherwise.

    ``seed``: decides all the rest, always in the same way.
    """

    generate: Mapping[str, Any]
    seed: WholeNumber = 0
    description: str = ""


def read_furniture(name: str | Path, asked_by: Problem | None = None) -> FurnitureModel:
    """The furniture of a shipped name or a file; raises ConfigurationError."""
    path = find_data("furniture", name, asked_by)
    document = read_document(path)
    return (_generated if "generate" in document.data else _written)(path.stem, document)


def _written(name: str, document: Document) -> FurnitureModel:
    file = check(document, FurnitureFile)
    return FurnitureModel(
        name=name,
        footprint=file.footprint,
        parts=placed_shapes(file.parts, document, "parts"),
        colors=tuple((*(part.color or PART_COLOR), 1.0) for part in file.parts),
        surfaces=tuple(Surface(key, Pose.from_xyz_rpy(s.xyz), s.size) for key, s in file.surfaces.items()),
        friction=file.friction,
        articulations=read_articulations(file.articulations, document),
    )


def _generated(name: str, document: Document) -> FurnitureModel:
    file = check(document, GeneratedFurnitureFile)
    kind = file.generate.get("kind")
    try:
        if not isinstance(kind, str):
            raise FurnitureOptionError(("kind",), "is missing" if kind is None else f"should be a name, got {kind!r}")
        below = document.below("generate")
        options_type = options_of(kind)
        wanted = {key: value for key, value in below.data.items() if key != "kind"}
        options: Any = check(Document(wanted, below.origins), options_type)
        given = {option.name: getattr(options, option.name) for option in fields(options_type)}
        return generate_furniture(kind, np.random.default_rng(file.seed), name, **given)
    except FurnitureOptionError as error:
        raise ConfigurationError([document.problem(("generate", *error.path), error.reason)]) from error
    except ConfigurationError as error:
        raise error.within("generate") from error
