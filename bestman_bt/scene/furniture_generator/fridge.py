"""A fridge: one door, or a freezer's door and a fridge's door above each other."""

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
from bestman_bt.scene.scene import FurnitureModel, Surface

_WALL, _PLINTH, _DOOR = 0.035, 0.05, 0.055
_INSIDE = (0.90, 0.92, 0.94)


@dataclass(frozen=True)
class FridgeOptions:
    """Options; missing ones are drawn. ``depth``: with the doors; ``doors``: 1, or 2 above each other.

    ``friction``: of each hinge, newton metres. Articulations: ``door``, or ``lower_door`` and ``upper_door``; surfaces:
    ``top`` and, behind the doors, ``shelf_1`` (lowest) and up.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    doors: Literal[1, 2] | None = None
    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)
    finish: FinishOptions = field(default_factory=FinishOptions)


def fridge(name: str, options: FridgeOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a fridge; raises FurnitureOptionError."""
    drawn = rng.uniform((0.54, 0.58, 1.30, 6.0), (0.68, 0.68, 1.80, 9.0))
    two, left, split_share = bool(rng.random() < 0.5), bool(rng.random() < 0.5), rng.uniform(0.30, 0.65)
    given = (options.width, options.depth, options.height, options.friction)
    width, depth, height, friction = (
        float(value if option is None else option) for option, value in zip(given, drawn, strict=True)
    )
    if height < 0.5:
        raise FurnitureOptionError(("height",), f"should be at least 0.5 m, got {height:g} m")
    count = options.doors or (2 if two and height >= 1.2 else 1)
    hinge: Literal["left", "right"] = options.hinge or ("left" if left else "right")
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(options.handle, rng, {"bar": 0.75, "edge": 0.25}, directions={"vertical": 1.0})
    thickness = design.leaf_thickness(_DOOR)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, _PLINTH, height, _WALL, finish.body)
    solids.append(block((front + 0.04, -half + 0.02, 0.0), (rear, half - 0.02, _PLINTH), (0.12, 0.12, 0.13)))
    inside = (front + 0.04, rear - _WALL), (-half + _WALL, half - _WALL)
    borders = [_PLINTH, height] if count == 1 else [_PLINTH, _PLINTH + split_share * (height - _PLINTH), height]
    surfaces: list[Surface] = [surface("top", (front, rear), (-half, half), height)]
    floors = [_PLINTH + _WALL]
    if count == 2:
        floors.append(borders[1] + _WALL / 2)
        lower = (front, inside[1][0], borders[1] - _WALL / 2)
        solids.append(block(lower, (inside[0][1], inside[1][1], borders[1] + _WALL / 2), finish.body))
    ceilings = [*(border - _WALL / 2 for border in borders[1:-1]), height - _WALL]
    shelves = list(floors)
    for low, high in zip(floors, ceilings, strict=True):
        compartments = max(1, int((high - low) / 0.30))
        for step in range(1, compartments):
            shelf = low + step * (high - low) / compartments
            lower = (inside[0][0], inside[1][0], shelf - 0.01)
            solids.append(block(lower, (inside[0][1], inside[1][1], shelf), _INSIDE))
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
