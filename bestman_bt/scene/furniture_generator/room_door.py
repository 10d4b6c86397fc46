"""A door between rooms: posts and a lintel that stand in a doorway, and a door that opens towards -x."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from bestman_bt.configuration.quantity import Torque
from bestman_bt.scene.furniture_generator.articulations import GAP, ArticulationDesign, Front, door
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions, draw_handle
from bestman_bt.scene.furniture_generator.option_error import FurnitureOptionError
from bestman_bt.scene.furniture_generator.panel import PieceOptions, draw_finish, given_or_drawn, model, surface
from bestman_bt.scene.furniture_generator.solid import block
from bestman_bt.scene.scene import FurnitureModel

_POST, _DOOR, _SLIT = 0.04, 0.038, 0.012


@dataclass(frozen=True)
class RoomDoorOptions(PieceOptions):
    """Options; missing ones are drawn. ``width``: with the frame, as wide as the doorway; ``depth``: of frame and door.

    ``hinge``: left or right, seen from -x, the side to which it opens. ``friction``: of the hinge, ``latch``: in
    addition at the frame; newton metres. Articulation: ``door``; surface: ``top`` of the lintel.
    """

    hinge: Literal["left", "right"] | None = None
    friction: Torque | None = None
    latch: Torque = 0.0
    handle: HandleOptions = field(default_factory=HandleOptions)


def room_door(name: str, options: RoomDoorOptions, rng: np.random.Generator) -> FurnitureModel:
    """Draw a room door; raises FurnitureOptionError."""
    drawn = rng.uniform((0.90, 0.12, 1.98, 6.0), (1.05, 0.16, 2.06, 9.0))
    left = bool(rng.random() < 0.5)
    width, depth, height, friction = given_or_drawn(options, drawn, "width", "depth", "height", "friction")
    hinge: Literal["left", "right"] = options.hinge or ("left" if left else "right")
    if height < 1.0:
        raise FurnitureOptionError(("height",), f"should be at least 1 m, got {height:g} m")
    finish = draw_finish(options.finish, rng, ("white", "wood"))
    design = draw_handle(
        options.handle, rng, {"bar": 0.7, "knob": 0.3}, directions={"vertical": 1.0}, largest_length=0.40
    )
    design = replace(design, height=0.0)  # hands reach for the middle of a door
    thickness = design.door_thickness(_DOOR)
    face, front, rear, half = -depth / 2, -depth / 2 + thickness + GAP, depth / 2, width / 2
    if rear - front < 0.03:
        raise FurnitureOptionError(("depth",), f"should be at least {thickness + GAP + 0.03:.3f} m, got {depth:g} m")
    solids = [
        block((front, -half, 0.0), (rear, -half + _POST, height), finish.body),
        block((front, half - _POST, 0.0), (rear, half, height), finish.body),
        block((front, -half + _POST, height - _POST), (rear, half - _POST, height), finish.body),
    ]
    panel = door(
        "door",
        Front((face, 0.0, (_SLIT + height) / 2), width, height - _SLIT),
        hinge,
        ArticulationDesign(design, finish, thickness, 220.0, friction),
        upper=1.75,
        latch=options.latch,
    )
    top = surface("top", (front, rear), (-half + _POST, half - _POST), height)
    return replace(model(name, (depth, width), solids, [top], [panel]), is_passage=True)
