"""Pieces that hold things: an open shelf, a chest of drawers, a cupboard with one or two doors hinged at its sides."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import Force, Torque, WholeNumber
from bestman_bt.scene.furniture_generator.articulations import GAP, SEAM, ArticulationDesign, Front, door, drawer
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import (
    PieceOptions,
    carcass,
    draw_finish,
    given_or_drawn,
    model,
    surface,
)
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel


@dataclass(frozen=True)
class ShelfOptions(PieceOptions):
    """Options; missing ones are drawn. ``boards``: 2 to 8, the lowest and the top one included; ``back``: a back wall.

    Surfaces: ``board_1`` (lowest) to ``top``.
    """

    boards: WholeNumber | None = None
    back: bool | None = None


def shelf(name: str, options: ShelfOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a shelf; raises FurnitureOptionError."""
    drawn = rng.uniform((0.60, 0.28, 0.80), (1.10, 0.40, 1.60))
    count, has_back = int(rng.integers(3, 6)), bool(rng.random() < 0.5)
    width, depth, height = given_or_drawn(options, drawn, "width", "depth", "height")
    count = count if options.boards is None else options.boards
    if not 2 <= count <= 8:
        raise FurnitureOptionError(("boards",), f"should be from 2 to 8, got {count}")
    thickness, lowest = 0.020, 0.08
    pitch = (height - lowest) / (count - 1)
    if pitch < 0.12:
        message = f"{count} boards in {height:g} m leave {pitch - thickness:.3f} m between them; 0.10 m is the least"
        raise FurnitureOptionError(("boards",), message)
    finish = draw_finish(options.finish, rng, ("white", "wood", "dark"))
    half, front, rear = width / 2, -depth / 2, depth / 2
    has_back = has_back if options.back is None else options.back
    solids = [
        block((front, -half, 0.0), (rear, -half + thickness, height), finish.body),
        block((front, half - thickness, 0.0), (rear, half, height), finish.body),
    ]
    inner_back = rear - 0.006 if has_back else rear
    if has_back:
        solids.append(block((inner_back, -half + thickness, lowest), (rear, half - thickness, height), finish.body))
    surfaces = []
    for index in range(count):
        top = lowest + index * pitch
        solids.append(
            block((front, -half + thickness, top - thickness), (inner_back, half - thickness, top), finish.front)
        )
        board = "top" if index == count - 1 else f"board_{index + 1}"
        surfaces.append(surface(board, (front, inner_back), (-half + thickness, half - thickness), top))
    return model(name, (depth, width), solids, surfaces)


@dataclass(frozen=True)
class DrawerChestOptions(PieceOptions):
    """Options; missing ones are drawn. ``drawers``: 1 to 6; ``depth``: with the fronts; ``friction``: of each, newtons.

    Articulations: ``drawer_1`` (lowest) and up; surfaces: ``top`` and the bottom of each drawer by the drawer's name,
    which moves with it.
    """

    drawers: WholeNumber | None = None
    friction: Force | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)


def drawer_chest(name: str, options: DrawerChestOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a chest of drawers; raises FurnitureOptionError."""
    board, plinth, least_front = 0.018, 0.06, 0.10
    drawn = rng.uniform((0.45, 0.42, 0.60, 15.0), (0.95, 0.52, 1.00, 22.0))
    count = int(rng.integers(2, 5))
    width, depth, height, friction = given_or_drawn(options, drawn, "width", "depth", "height", "friction")
    count = count if options.drawers is None else options.drawers
    if not 1 <= count <= 6:
        raise FurnitureOptionError(("drawers",), f"should be from 1 to 6, got {count}")
    finish = draw_finish(options.finish, rng)
    design = draw_handle(
        options.handle, rng, {"bar": 0.5, "knob": 0.3, "edge": 0.2}, directions={"horizontal": 1.0, "vertical": 0.0}
    )
    panel = design.lip if design.kind == "edge" else 0.020
    face, front, rear, half = -depth / 2, -depth / 2 + panel + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, plinth, height - board, board, finish.body)
    solids.append(block((front + 0.03, -half + 0.02, 0.0), (rear, half - 0.02, plinth), finish.body))
    solids.append(block((face, -half, height - board), (rear, half, height), finish.body))
    pitch = (height - board - plinth) / count
    if pitch < least_front:
        message = f"{count} drawers in {height:g} m leave fronts of {pitch:.3f} m; {least_front} m is the least"
        raise FurnitureOptionError(("drawers",), message)
    box_depth = rear - board - front - 0.03
    drawers = []
    for index in range(count):
        middle = plinth + (index + 0.5) * pitch
        drawers.append(
            drawer(
                f"drawer_{index + 1}",
                Front((face, 0.0, middle), width - SEAM, pitch - SEAM),
                ArticulationDesign(design, finish, panel, 600.0, friction),
                depth=box_depth,
                box_width=width - 2 * board - 0.016,
                upper=round(0.8 * box_depth, 3),
            )
        )
    top = surface("top", (face, rear), (-half, half), height)
    return model(name, (depth, width), solids, [top], drawers)


@dataclass(frozen=True)
class CupboardOptions(PieceOptions):
    """Options; missing ones are drawn. ``depth``: with the doors; ``doors``: 1 or 2; ``hinge``: of a single one.

    ``friction``: of each hinge, newton metres. Articulations: ``door``, or ``left_door`` and ``right_door`` (seen from
    the front); surfaces: ``top`` and, behind the doors, ``shelf_1`` and ``shelf_2``.
    """

    doors: Literal[1, 2] | None = None
    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)


def cupboard(name: str, options: CupboardOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a cupboard; raises FurnitureOptionError."""
    board, plinth = 0.018, 0.08
    drawn = rng.uniform((0.40, 0.36, 0.70, 6.0), (0.60, 0.58, 1.00, 9.0))
    two, left = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    count = options.doors or (2 if two else 1)
    drawn[0] *= 1.0 if count == 1 else 1.6
    width, depth, height, friction = given_or_drawn(options, drawn, "width", "depth", "height", "friction")
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
    thickness = design.door_thickness(0.020)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, plinth, height, board, finish.body)
    solids.append(block((front + 0.04, -half + 0.02, 0.0), (rear, half - 0.02, plinth), (0.15, 0.15, 0.16)))
    inside = (front + 0.02, rear - board), (-half + board, half - board)
    middle = (plinth + height) / 2
    corner = (inside[0][1], inside[1][1], middle)
    solids.append(block((inside[0][0], inside[1][0], middle - board), corner, finish.body))
    surfaces = [
        surface("top", (front, rear), (-half, half), height),
        surface("shelf_1", *inside, plinth + board),
        surface("shelf_2", *inside, middle),
    ]
    sides: tuple[Literal["left", "right"], ...] = ("left", "right")
    if count == 1:
        sides = (options.hinge or ("left" if left else "right"),)
    elif options.hinge is not None:
        raise FurnitureOptionError(
            ("hinge",), f"is for a single door; two are hinged at their sides, got {count} doors"
        )
    door_width = width if count == 1 else (width - SEAM) / 2
    doors = []
    for side in sides:
        y = 0.0 if count == 1 else (half - door_width / 2) * (1.0 if side == "left" else -1.0)
        doors.append(
            door(
                "door" if count == 1 else f"{side}_door",
                Front((face, y, middle), door_width, height - plinth - SEAM),
                side,
                ArticulationDesign(design, finish, thickness, 600.0 if design.kind != "edge" else 300.0, friction),
                upper=1.7,
            )
        )
    return model(name, (depth, width), solids, surfaces, doors)
