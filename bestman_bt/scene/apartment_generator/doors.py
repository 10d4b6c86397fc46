"""Doors in the doorways of an apartment, hung so that their leaves open freely."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bestman_bt.messages import Pose2D
from bestman_bt.scene.apartment_generator.floor_plan import Doorway, FloorPlan
from bestman_bt.scene.apartment_generator.options import ApartmentOptions
from bestman_bt.scene.apartment_generator.placed import Placed
from bestman_bt.scene.furniture_generator import HandleOptions, generate_furniture
from bestman_bt.scene.plane_geometry import Points, polygons_overlap, wall_rectangle
from bestman_bt.scene.scene import PlacedFurniture, Wall
from bestman_bt.scene.standing_outlines import body_outlines, leaf_outlines

POST = 0.04
"""Metres of the doorway that each post of a door takes."""
_OPEN, _HALF_OPEN = (math.radians(90.0), math.radians(100.0)), (math.radians(66.0), math.radians(80.0))
_TRIES = 12
_BEFORE_WALL = 0.092  # half the depth of the frame: the leaf swings before the wall, not in it


def hang_doors(
    plan: FloorPlan, furniture: Sequence[Placed], options: ApartmentOptions, rng: np.random.Generator
) -> list[Placed] | None:
    """A door for each doorway that shall have one; None where a leaf finds no room."""
    standing: list[Points] = [
        wall_rectangle(Wall(*line, options.wall_height, options.wall_thickness)) for line in plan.walls
    ]
    standing += [piece.outline for piece in furniture]
    doors: list[Placed] = []
    for doorway in plan.doorways:
        if doorway.has_door:
            door = _hung(f"room_door_{len(doors) + 1}", doorway, standing, options, rng)
            if door is None:
                return None
            doors.append(door)
            standing += [*body_outlines(as_standing(door)), *leaf_outlines(as_standing(door))]
    return doors


def as_standing(piece: Placed) -> PlacedFurniture:
    """The piece exactly where it shall stand."""
    return PlacedFurniture(piece.name, piece.model, piece.at, piece.at, open=piece.open)


def _hung(
    name: str, doorway: Doorway, standing: Sequence[Points], options: ApartmentOptions, rng: np.random.Generator
) -> Placed | None:
    for _ in range(_TRIES):
        hinge = "left" if rng.random() < 0.5 else "right"
        turn = math.pi * int(rng.integers(2)) + (math.pi / 2 if doorway.along == 0 else 0.0)
        position = float(rng.uniform(*(_HALF_OPEN if rng.random() < options.half_open else _OPEN)))
        model = generate_furniture(
            "room_door",
            rng,
            width=doorway.opening,
            depth=2 * _BEFORE_WALL,
            height=2.0,
            hinge=hinge,
            handle=HandleOptions(kind="bar"),
        )
        door = Placed(name, model, Pose2D(*doorway.at, turn), {"door": position})
        if not any(polygons_overlap(leaf, other) for leaf in leaf_outlines(as_standing(door)) for other in standing):
            return door
    return None


def moved_doors(doors: Sequence[Placed], options: ApartmentOptions, rng: np.random.Generator) -> list[Placed]:
    """The doors as they stand now: some were opened otherwise since the map was made."""
    return [
        replace(door, open={"door": float(rng.uniform(_HALF_OPEN[0], _OPEN[1]))})
        if rng.random() < options.moved_doors
        else door
        for door in doors
    ]
