"""A cupboard with one or two doors that are hinged at its sides."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import PositiveLength, Torque
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.leaf import GAP, SEAM, ArticulationDesign, Front, door
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions, carcass, draw_finish, model, surface
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel

_BOARD, _PLINTH, _DOOR = 0.018, 0.08, 0.020


@dataclass(frozen=True)
class CupboardOptions:
    """Options; missing ones are drawn. ``depth``: with the doors; ``doors``: 1 or 2; ``hinge``: of a single one.

    ``friction``: of each hinge, newton metres. Articulations: ``door``, or ``left_door`` and ``right_door`` (seen from
    the front); surfaces: ``top`` and, behind the doors, ``shelf_1`` and ``shelf_2``.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    doors: Literal[1, 2] | None = None
    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)
    finish: FinishOptions = field(default_factory=FinishOptions)


def cupboard(name: str, options: CupboardOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a cupboard; raises FurnitureOptionError."""
    drawn = rng.uniform((0.40, 0.36, 0.70, 6.0), (0.60, 0.58, 1.00, 9.0))
    two, left = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    given = (options.width, options.depth, options.height, options.friction)
    count = options.doors or (2 if two else 1)
    drawn[0] *= 1.0 if count == 1 else 1.6
    width, depth, height, friction = (
        float(value if option is None else option) for option, value in zip(given, drawn, strict=True)
    )
    if height < 0.3:
        raise FurnitureOptionError(("height",), f"should be at least 0.3 m, got {height:g} m")
    finish = draw_finish(options.finish, rng)
    design = draw_handle(
        options.handle,
        rng,
        {"bar": 0.5, "knob": 0.3, "edge": 0.2},
        directions={"vertical": 0.8, "horizontal": 0.2},
        largest_length=0.30,
    )
    thickness = design.leaf_thickness(_DOOR)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, _PLINTH, height, _BOARD, finish.body)
    solids.append(block((front + 0.04, -half + 0.02, 0.0), (rear, half - 0.02, _PLINTH), (0.15, 0.15, 0.16)))
    inside = (front + 0.02, rear - _BOARD), (-half + _BOARD, half - _BOARD)
    middle = (_PLINTH + height) / 2
    corner = (inside[0][1], inside[1][1], middle)
    solids.append(block((inside[0][0], inside[1][0], middle - _BOARD), corner, finish.body))
    surfaces = [
        surface("top", (front, rear), (-half, half), height),
        surface("shelf_1", *inside, _PLINTH + _BOARD),
        surface("shelf_2", *inside, middle),
    ]
    sides: tuple[Literal["left", "right"], ...] = ("left", "right")
    if count == 1:
        sides = (options.hinge or ("left" if left else "right"),)
    elif options.hinge is not None:
        raise FurnitureOptionError(
            ("hinge",), f"is for a single door; two are hinged at their sides, got {count} doors"
        )
    leaf_width = width if count == 1 else (width - SEAM) / 2
    doors = []
    for side in sides:
        y = 0.0 if count == 1 else (half - leaf_width / 2) * (1.0 if side == "left" else -1.0)
        doors.append(
            door(
                "door" if count == 1 else f"{side}_door",
                Front((face, y, middle), leaf_width, height - _PLINTH - SEAM),
                side,
                ArticulationDesign(design, finish, thickness, 600.0 if design.kind != "edge" else 300.0, friction),
                upper=1.7,
            )
        )
    return model(name, (depth, width), solids, surfaces, doors)
