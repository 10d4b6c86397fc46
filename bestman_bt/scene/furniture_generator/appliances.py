"""Kitchen appliances.

A fridge has one door, or two, a freezer's and a fridge's, one above the other; a dishwasher, or an oven of that form,
has one that is hinged at its bottom; a microwave oven, which stands on other furniture, one with a window, and keys and
a knob beside it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import Torque
from bestman_bt.messages import GRAVITY
from bestman_bt.scene.furniture_generator.articulations import GAP, SEAM, ArticulationDesign, Front, door
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
from bestman_bt.scene.furniture_generator.solid import block, rod
from bestman_bt.scene.scene import FurnitureModel, Surface


@dataclass(frozen=True)
class FridgeOptions(PieceOptions):
    """Options; missing ones are drawn. ``depth``: with the doors; ``doors``: 1, or 2, one above the other.

    ``friction``: of each hinge, newton metres. Articulations: ``door``, or ``lower_door`` and ``upper_door``; surfaces:
    ``top`` and, behind the doors, ``shelf_1`` (lowest) and up.
    """

    doors: Literal[1, 2] | None = None
    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)


def fridge(name: str, options: FridgeOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a fridge; raises FurnitureOptionError."""
    wall, plinth = 0.035, 0.05
    drawn = rng.uniform((0.54, 0.58, 1.30, 6.0), (0.68, 0.68, 1.80, 9.0))
    two, left, split_share = bool(rng.random() < 0.5), bool(rng.random() < 0.5), rng.uniform(0.30, 0.65)
    width, depth, height, friction = given_or_drawn(options, drawn, "width", "depth", "height", "friction")
    if height < 0.5:
        raise FurnitureOptionError(("height",), f"should be at least 0.5 m, got {height:g} m")
    count = options.doors or (2 if two and height >= 1.2 else 1)
    hinge: Literal["left", "right"] = options.hinge or ("left" if left else "right")
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(options.handle, rng, {"bar": 0.75, "edge": 0.25}, directions={"vertical": 1.0})
    thickness = design.door_thickness(0.055)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, plinth, height, wall, finish.body)
    solids.append(block((front + 0.04, -half + 0.02, 0.0), (rear, half - 0.02, plinth), (0.12, 0.12, 0.13)))
    inside = (front + 0.04, rear - wall), (-half + wall, half - wall)
    borders = [plinth, height] if count == 1 else [plinth, plinth + split_share * (height - plinth), height]
    surfaces: list[Surface] = [surface("top", (front, rear), (-half, half), height)]
    floors = [plinth + wall]
    if count == 2:
        floors.append(borders[1] + wall / 2)
        lower = (front, inside[1][0], borders[1] - wall / 2)
        solids.append(block(lower, (inside[0][1], inside[1][1], borders[1] + wall / 2), finish.body))
    ceilings = [*(border - wall / 2 for border in borders[1:-1]), height - wall]
    shelves = list(floors)
    for low, high in zip(floors, ceilings, strict=True):
        compartments = max(1, int((high - low) / 0.30))
        for step in range(1, compartments):
            shelf = low + step * (high - low) / compartments
            lower = (inside[0][0], inside[1][0], shelf - 0.01)
            solids.append(block(lower, (inside[0][1], inside[1][1], shelf), (0.90, 0.92, 0.94)))
            shelves.append(shelf)
    surfaces += [surface(f"shelf_{i}", *inside, z) for i, z in enumerate(sorted(shelves), start=1)]
    doors = [
        door(
            "door" if count == 1 else f"{which}_door",
            Front((face, 0.0, (low + high) / 2), width, high - low - SEAM),
            hinge,
            ArticulationDesign(design, finish, thickness, 250.0, friction),
            upper=1.9,
        )
        for which, low, high in zip(("lower", "upper"), borders[:-1], borders[1:], strict=False)
    ]
    return model(name, (depth, width), solids, surfaces, doors)


_LEAST_FRICTION = 6.0  # N m; less would let an open hand push it open


@dataclass(frozen=True)
class DishwasherOptions(PieceOptions):
    """Options; missing ones are drawn. ``depth``: with the door.

    ``friction``: of the hinge, newton metres; by default a fifth more than the open door's weight, at least 6, so that
    it stays in place like a spring-balanced one. ``latch``: newton metres to unlatch the closed door, in addition.
    Articulation: ``door``; surfaces: ``top`` and ``inside``.
    """

    friction: Torque | None = None
    latch: Torque = 0.0
    handle: HandleOptions = field(default_factory=HandleOptions)


def dishwasher(name: str, options: DishwasherOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a dishwasher; raises FurnitureOptionError."""
    wall, plinth, board = 0.020, 0.10, 0.025
    drawn = rng.uniform((0.45, 0.55, 0.80), (0.60, 0.62, 0.90))
    width, depth, height = given_or_drawn(options, drawn, "width", "depth", "height")
    if height < 0.4:
        raise FurnitureOptionError(("height",), f"should be at least 0.4 m, got {height:g} m")
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(options.handle, rng, {"bar": 0.7, "edge": 0.3}, directions={"horizontal": 1.0})
    thickness = design.door_thickness(0.035)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, plinth, height - board, wall, finish.body)
    solids.append(block((front + 0.04, -half + 0.01, 0.0), (rear, half - 0.01, plinth), (0.15, 0.15, 0.16)))
    solids.append(block((face, -half, height - board), (rear, half, height), finish.body))
    bottom, top, density = plinth, height - board - SEAM, 180.0
    weight = density * width * thickness * (top - bottom) * GRAVITY
    front_door = door(
        "door",
        Front((face, 0.0, (bottom + top) / 2), width - SEAM, top - bottom),
        "bottom",
        ArticulationDesign(
            design,
            finish,
            thickness,
            density,
            max(_LEAST_FRICTION, 1.2 * weight * (top - bottom) / 2) if options.friction is None else options.friction,
        ),
        upper=1.5,
        latch=options.latch,
    )
    surfaces = [
        surface("top", (face, rear), (-half, half), height),
        surface("inside", (front, rear - wall), (-half + wall, half - wall), plinth + wall),
    ]
    return model(name, (depth, width), solids, surfaces, [front_door])


_GLASS, _DISPLAY, _PLATE = (0.05, 0.06, 0.08), (0.10, 0.55, 0.45), (0.80, 0.88, 0.90)


@dataclass(frozen=True)
class MicrowaveOptions(PieceOptions):
    """Options; missing ones are drawn. ``depth``: with the door; ``friction``: of the hinge, newton metres.

    Articulation: ``door``; surfaces: ``top`` and, behind the door, ``inside``. The knob beside the door is fixed: it
    resembles a handle.
    """

    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)


def microwave(name: str, options: MicrowaveOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a microwave; raises FurnitureOptionError."""
    wall, foot = 0.015, 0.010
    drawn = rng.uniform((0.45, 0.34, 0.26, 6.0), (0.56, 0.42, 0.33, 8.0))
    left, door_share, knobs = bool(rng.random() < 0.85), rng.uniform(0.70, 0.78), int(rng.integers(0, 3))
    width, depth, height, friction = given_or_drawn(options, drawn, "width", "depth", "height", "friction")
    if height < 0.2:
        raise FurnitureOptionError(("height",), f"should be at least 0.2 m, got {height:g} m")
    hinge: Literal["left", "right"] = options.hinge or ("left" if left else "right")
    side = 1.0 if hinge == "left" else -1.0  # of the hinge, along y
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(
        options.handle, rng, {"bar": 0.8, "edge": 0.2}, directions={"vertical": 1.0}, largest_length=0.30
    )
    thickness = design.door_thickness(0.028)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    door_width = door_share * width
    solids = carcass(front, rear, width, foot, height, wall, finish.body)
    for x in (front + 0.03, rear - 0.03):
        solids += [rod((x, y, foot / 2), "z", 0.012, foot, (0.1, 0.1, 0.1)) for y in (-half + 0.04, half - 0.04)]

    def across(hinge_distance: float) -> float:
        return side * (half - hinge_distance)

    beside = sorted((across(door_width + SEAM), across(width)))
    solids.append(block((face, beside[0], foot), (front, beside[1], height), finish.front))
    inner = sorted((across(door_width - 0.02), across(width - wall)))
    solids.append(block((front, inner[0], foot + wall), (rear - wall, inner[1], height - wall), finish.body))
    middle = across((door_width + SEAM + width) / 2)
    solids.append(block((face - 0.001, middle - 0.035, height - 0.07), (face, middle + 0.035, height - 0.04), _DISPLAY))
    for index in range(knobs):
        z = 0.075 + 0.075 * index
        solids.append(rod((face - 0.008, middle, z), "x", 0.018, 0.016, finish.handle))
    cavity = sorted((across(wall), across(door_width - 0.02)))
    plate = (min(cavity[1] - cavity[0], rear - wall - front) - 0.05) / 2
    centre = ((front + rear - wall) / 2, sum(cavity) / 2, foot + wall + 0.004)
    solids.append(rod(centre, "z", plate, 0.008, _PLATE))
    inside = surface(
        "inside",
        (centre[0] - plate * 0.7, centre[0] + plate * 0.7),
        (centre[1] - plate * 0.7, centre[1] + plate * 0.7),
        centre[2] + 0.004,
    )
    window_width, window_height = door_width - 0.24, height - foot - 0.10
    window = block((-window_width / 2, -window_height / 2, 0.0), (window_width / 2, window_height / 2, 0.001), _GLASS)
    front_door = door(
        "door",
        Front((face, across(door_width / 2), (foot + height) / 2), door_width, height - foot),
        hinge,
        ArticulationDesign(design, finish, thickness, 500.0, friction),
        upper=1.75,
        extra=[window] if window_width > 0.05 else [],
    )
    return model(
        name, (depth, width), solids, [surface("top", (front, rear), (-half, half), height), inside], [front_door]
    )
