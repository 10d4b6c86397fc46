"""A dishwasher, or an oven of that form: one door that is hinged at its bottom."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bestman_bt.configuration.quantity import PositiveLength, Torque
from bestman_bt.messages import GRAVITY
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.leaf import GAP, SEAM, ArticulationDesign, Front, door
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions, carcass, draw_finish, model, surface
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel

_WALL, _PLINTH, _DOOR, _TOP = 0.020, 0.10, 0.035, 0.025
_LEAST_FRICTION = 6.0  # N m; less would let an open hand push it open


@dataclass(frozen=True)
class DishwasherOptions:
    """Options; missing ones are drawn. ``depth``: with the door.

    ``friction``: of the hinge, newton metres; by default a fifth more than the open door's weight, at least 6, so that
    it stays in place like a spring-balanced one. ``latch``: newton metres to unlatch the closed door, in addition.
    Articulation: ``door``; surfaces: ``top`` and ``inside``.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    friction: Torque | None = None
    latch: Torque = 0.0
    handle: HandleOptions = field(default_factory=HandleOptions)
    finish: FinishOptions = field(default_factory=FinishOptions)


def dishwasher(name: str, options: DishwasherOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a dishwasher; raises FurnitureOptionError."""
    drawn = rng.uniform((0.45, 0.55, 0.80), (0.60, 0.62, 0.90))
    width, depth, height = (
        float(given or value)
        for given, value in zip((options.width, options.depth, options.height), drawn, strict=True)
    )
    if height < 0.4:
        raise FurnitureOptionError(("height",), f"should be at least 0.4 m, got {height:g} m")
    finish = draw_finish(options.finish, rng, ("white", "steel", "dark"))
    design = draw_handle(options.handle, rng, {"bar": 0.7, "edge": 0.3}, directions={"horizontal": 1.0})
    thickness = design.leaf_thickness(_DOOR)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, _PLINTH, height - _TOP, _WALL, finish.body)
    solids.append(block((front + 0.04, -half + 0.01, 0.0), (rear, half - 0.01, _PLINTH), (0.15, 0.15, 0.16)))
    solids.append(block((face, -half, height - _TOP), (rear, half, height), finish.body))
    bottom, top, density = _PLINTH, height - _TOP - SEAM, 180.0
    weight = density * width * thickness * (top - bottom) * GRAVITY
    leaf = door(
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
        surface("inside", (front, rear - _WALL), (-half + _WALL, half - _WALL), _PLINTH + _WALL),
    ]
    return model(name, (depth, width), solids, surfaces, [leaf])
