"""A chest of drawers."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bestman_bt.configuration.quantity import Force, PositiveLength, WholeNumber
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.leaf import GAP, SEAM, ArticulationDesign, Front, drawer
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import FinishOptions, carcass, draw_finish, model, surface
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel

_BOARD, _PLINTH, _PANEL = 0.018, 0.06, 0.020
_LEAST_FRONT = 0.10


@dataclass(frozen=True)
class DrawerChestOptions:
    """Options; missing ones are drawn. ``drawers``: 1 to 6; ``depth``: with the fronts; ``friction``: of each, newtons.

    Articulations: ``drawer_1`` (lowest) and up; surfaces: ``top`` and the bottom of each drawer by the drawer's name,
    which moves with it.
    """

    width: PositiveLength | None = None
    depth: PositiveLength | None = None
    height: PositiveLength | None = None
    drawers: WholeNumber | None = None
    friction: Force | None = None
    handle: HandleOptions = field(default_factory=HandleOptions)
    finish: FinishOptions = field(default_factory=FinishOptions)


def drawer_chest(name: str, options: DrawerChestOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a chest of drawers; raises FurnitureOptionError."""
    drawn = rng.uniform((0.45, 0.42, 0.60, 15.0), (0.95, 0.52, 1.00, 22.0))
    count = int(rng.integers(2, 5))
    given = (options.width, options.depth, options.height, options.friction)
    width, depth, height, friction = (
        float(value if option is None else option) for option, value in zip(given, drawn, strict=True)
    )
    count = count if options.drawers is None else options.drawers
    if not 1 <= count <= 6:
        raise FurnitureOptionError(("drawers",), f"should be from 1 to 6, got {count}")
    finish = draw_finish(options.finish, rng)
    design = draw_handle(
        options.handle, rng, {"bar": 0.5, "knob": 0.3, "edge": 0.2}, directions={"horizontal": 1.0, "vertical": 0.0}
    )
    panel = design.lip if design.kind == "edge" else _PANEL
    face, front, rear, half = -depth / 2, -depth / 2 + panel + GAP, depth / 2, width / 2
    solids = carcass(front, rear, width, _PLINTH, height - _BOARD, _BOARD, finish.body)
    solids.append(block((front + 0.03, -half + 0.02, 0.0), (rear, half - 0.02, _PLINTH), finish.body))
    solids.append(block((face, -half, height - _BOARD), (rear, half, height), finish.body))
    pitch = (height - _BOARD - _PLINTH) / count
    if pitch < _LEAST_FRONT:
        message = f"{count} drawers in {height:g} m leave fronts of {pitch:.3f} m; {_LEAST_FRONT} m is the least"
        raise FurnitureOptionError(("drawers",), message)
    box_depth = rear - _BOARD - front - 0.03
    drawers = []
    for index in range(count):
        middle = _PLINTH + (index + 0.5) * pitch
        drawers.append(
            drawer(
                f"drawer_{index + 1}",
                Front((face, 0.0, middle), width - SEAM, pitch - SEAM),
                ArticulationDesign(design, finish, panel, 600.0, friction),
                depth=box_depth,
                box_width=width - 2 * _BOARD - 0.016,
                upper=round(0.8 * box_depth, 3),
            )
        )
    top = surface("top", (face, rear), (-half, half), height)
    return model(name, (depth, width), solids, [top], drawers)
