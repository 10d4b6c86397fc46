"""A microwave oven: a door with a window, keys and a knob beside it. It stands on other furniture."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import PositiveLength, Torque
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.leaf import GAP, SEAM, ArticulationDesign, Front, door
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions, carcass, draw_finish, model, surface
from bestman_bt.scene.furniture_generator.solid import block, rod
from bestman_bt.scene.scene import FurnitureModel

_WALL, _DOOR, _FOOT = 0.015, 0.028, 0.010
_GLASS, _DISPLAY, _PLATE = (0.05, 0.06, 0.08), (0.10, 0.55, 0.45), (0.80, 0.88, 0.90)


@dataclass(frozen=True)
class MicrowaveOptions:
    """Options; missing ones are drawn. ``depth``: with the door; ``friction``: of the hinge, newton metres.

    Articulation: ``door``; surfaces: ``top`` and, behind the door, ``inside``. The knob beside the door is fixed: it
    resembles a handle.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)
    finish: FinishOptions = field(default_factory=FinishOptions)


def microwave(name: str, options: MicrowaveOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a microwave; raises FurnitureOptionError."""
    drawn = rng.uniform((0.45, 0.34, 0.26, 6.0), (0.56, 0.42, 0.33, 8.0))
    left, door_share, knobs = bool(rng.random() < 0.85), rng.uniform(0.70, 0.78), int(rng.integers(0, 3))
    given = (options.width, options.depth, options.height, options.friction)
    width, depth, height, friction = (
        float(value if option is None else option) for option, value in zip(given, drawn, strict=True)
    )
    if height < 0.2:
        raise FurnitureOptionError(("height",), f"should be at least 0.2 m, got {height:g} m")
    hinge: Literal["left", "right"] = options.hinge or ("left" if left else "right")
    side = 1.0 if hinge == "left" else -1.0  # of the hinge, along y
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(
        options.handle, rng, {"bar": 0.8, "edge": 0.2}, directions={"vertical": 1.0}, largest_length=0.30
    )
    thickness = design.leaf_thickness(_DOOR)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    leaf = door_share * width
    solids = carcass(front, rear, width, _FOOT, height, _WALL, finish.body)
    for x in (front + 0.03, rear - 0.03):
        solids += [rod((x, y, _FOOT / 2), "z", 0.012, _FOOT, (0.1, 0.1, 0.1)) for y in (-half + 0.04, half - 0.04)]

    def across(hinge_distance: float) -> float:
        return side * (half - hinge_distance)

    beside = sorted((across(leaf + SEAM), across(width)))
    solids.append(block((face, beside[0], _FOOT), (front, beside[1], height), finish.front))
    inner = sorted((across(leaf - 0.02), across(width - _WALL)))
    solids.append(block((front, inner[0], _FOOT + _WALL), (rear - _WALL, inner[1], height - _WALL), finish.body))
    middle = across((leaf + SEAM + width) / 2)
    solids.append(block((face - 0.001, middle - 0.035, height - 0.07), (face, middle + 0.035, height - 0.04), _DISPLAY))
    for index in range(knobs):
        z = 0.075 + 0.075 * index
        solids.append(rod((face - 0.008, middle, z), "x", 0.018, 0.016, finish.handle))
    cavity = sorted((across(_WALL), across(leaf - 0.02)))
    plate = (min(cavity[1] - cavity[0], rear - _WALL - front) - 0.05) / 2
    centre = ((front + rear - _WALL) / 2, sum(cavity) / 2, _FOOT + _WALL + 0.004)
    solids.append(rod(centre, "z", plate, 0.008, _PLATE))
    inside = surface(
        "inside",
        (centre[0] - plate * 0.7, centre[0] + plate * 0.7),
        (centre[1] - plate * 0.7, centre[1] + plate * 0.7),
        centre[2] + 0.004,
    )
    window_width, window_height = leaf - 0.24, height - _FOOT - 0.10
    window = block((-window_width / 2, -window_height / 2, 0.0), (window_width / 2, window_height / 2, 0.001), _GLASS)
    leaf_door = door(
        "door",
        Front((face, across(leaf / 2), (_FOOT + height) / 2), leaf, height - _FOOT),
        hinge,
        ArticulationDesign(design, finish, thickness, 500.0, friction),
        upper=1.75,
        extra=[window] if window_width > 0.05 else [],
    )
    return model(
        name, (depth, width), solids, [surface("top", (front, rear), (-half, half), height), inside], [leaf_door]
    )
