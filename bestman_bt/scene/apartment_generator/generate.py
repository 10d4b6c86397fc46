"""Generation of one apartment: plans and furnishings are drawn until all of it is accessible."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import Error
from bestman_bt.messages import Pose2D
from bestman_bt.scene.apartment_generator.floor_plan import Doorway, FloorPlan, Line, Room, floor_plan
from bestman_bt.scene.apartment_generator.furnish import OFFSET, TURN, furnish
from bestman_bt.scene.apartment_generator.options import ApartmentOptions, ApartmentPiece
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.furniture_generator.generate import generate_furniture
from bestman_bt.scene.furniture_generator.handle_design import HandleOptions
from bestman_bt.scene.placing import articulation_outlines, body_outlines, standing_outlines
from bestman_bt.scene.plane_geometry import Points, polygons_overlap, rectangle, wall_rectangle
from bestman_bt.scene.scene import PlacedFurniture, Wall

POST = 0.04
"""Metres of the doorway that each post of a door takes."""
_OPEN, _HALF_OPEN = (math.radians(90.0), math.radians(100.0)), (math.radians(66.0), math.radians(80.0))
_TRIES = 12
_BEFORE_WALL = 0.092  # half the depth of the frame: the outline swings before the wall, not in it


def place_doors(
    plan: FloorPlan, furniture: Sequence[ApartmentPiece], options: ApartmentOptions, rng: np.random.Generator
) -> list[ApartmentPiece] | None:
    """Return a door for each doorway with a door, or None if one has no room."""
    standing: list[Points] = [
        wall_rectangle(Wall(*line, options.wall_height, options.wall_thickness)) for line in plan.walls
    ]
    standing += [piece.outline for piece in furniture]
    doors: list[ApartmentPiece] = []
    for doorway in plan.doorways:
        if doorway.has_door:
            door = _hung(f"room_door_{len(doors) + 1}", doorway, standing, options, rng)
            if door is None:
                return None
            doors.append(door)
            standing += [*body_outlines(at_nominal_pose(door)), *articulation_outlines(at_nominal_pose(door))]
    return doors


def at_nominal_pose(piece: ApartmentPiece) -> PlacedFurniture:
    """Return the piece exactly at its nominal pose."""
    return PlacedFurniture(piece.name, piece.model, piece.at, piece.at, open=piece.open)


def _hung(
    name: str, doorway: Doorway, standing: Sequence[Points], options: ApartmentOptions, rng: np.random.Generator
) -> ApartmentPiece | None:
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
        door = ApartmentPiece(name, model, Pose2D(*doorway.at, turn), {"door": position})
        if not any(
            polygons_overlap(outline, other)
            for outline in articulation_outlines(at_nominal_pose(door))
            for other in standing
        ):
            return door
    return None


def moved_doors(
    doors: Sequence[ApartmentPiece], options: ApartmentOptions, rng: np.random.Generator
) -> list[ApartmentPiece]:
    """Return the doors with their current openings, some of which have changed since the map was made."""
    return [
        replace(door, open={"door": float(rng.uniform(_HALF_OPEN[0], _OPEN[1]))})
        if rng.random() < options.moved_doors
        else door
        for door in doors
    ]


_ATTEMPTS = 400
_FREE_FLOOR = 0.5
"""Smallest area of each room, square metres, that the centre of a robot can reach."""


class ApartmentError(Error, RuntimeError):
    """The options leave no room for an apartment."""


@dataclass(frozen=True)
class Apartment:
    """``walls``: ends of centre lines in the map frame, origin in the middle. ``furniture``: as mapped.

    ``doors``: as mapped; ``doors_now``: with their actual openings.
    """

    rooms: tuple[Room, ...]
    doorways: tuple[Doorway, ...]
    walls: tuple[Line, ...]
    furniture: tuple[ApartmentPiece, ...]
    doors: tuple[ApartmentPiece, ...] = ()
    doors_now: tuple[ApartmentPiece, ...] = ()


def generate_apartment(options: ApartmentOptions, seed: int, passage: float = 0.37) -> Apartment:
    """Return the apartment of a seed. Raises ApartmentError if none is found.

    A disc of the radius ``passage``, metres, can reach every room from every other one, for all poses of the furniture
    within its limits, and all openings of the doors.
    """
    for attempt in range(_ATTEMPTS):
        rng, door_rng = np.random.default_rng([seed, attempt]), np.random.default_rng([seed, attempt, 1])
        plan = floor_plan(options, rng, door_rng, POST)
        furniture = furnish(plan, options.wall_thickness, rng) if plan is not None else None
        if plan is None or furniture is None:
            continue
        doors = place_doors(plan, furniture, options, door_rng)
        if doors is None:
            continue
        now = moved_doors(doors, options, door_rng)
        if all(_is_connected(plan, furniture, hung, options, passage) for hung in (doors, now)):
            return Apartment(plan.rooms, plan.doorways, plan.walls, tuple(furniture), tuple(doors), tuple(now))
    (fewest, most), (least, largest), (narrow, wide) = options.rooms, options.area, options.doorway
    raise ApartmentError(
        f"no apartment in {_ATTEMPTS} draws (seed {seed}) of {fewest} to {most} rooms on {least:g} to {largest:g} m² "
        f"with doorways of {narrow:g} to {wide:g} m and a way of {2.0 * passage:g} m; give each room 14 to 24 m², "
        "wider doorways, or a smaller 'passage'"
    )


def _within(room: Room, points: Points) -> NDArray[np.bool_]:
    """Return which of the points (N, 2) are in a room."""
    inside: NDArray[np.bool_] = np.all((points >= (room.x[0], room.y[0])) & (points <= (room.x[1], room.y[1])), axis=1)
    return inside


def _is_connected(
    plan: FloorPlan,
    furniture: list[ApartmentPiece],
    doors: list[ApartmentPiece],
    options: ApartmentOptions,
    passage: float,
) -> bool:
    """Return whether all doorways and enough floor of each room belong to one area."""
    outlines = [wall_rectangle(Wall(*line, options.wall_height, options.wall_thickness)) for line in plan.walls]
    for piece in furniture:
        depth, width = piece.model.footprint
        grown = (depth + 2 * OFFSET + width * TURN, width + 2 * OFFSET + depth * TURN)
        outlines.append(rectangle(piece.at, grown))
    outlines += standing_outlines((), map(at_nominal_pose, doors))
    grid = FloorGrid.of(outlines)
    areas = grid.areas(passage)
    if plan.doorways:
        at_doorways = areas[grid.cells([doorway.at for doorway in plan.doorways])]
        if not np.all((at_doorways == at_doorways[0]) & (at_doorways > 0)):
            return False
        area = int(at_doorways[0])
    else:  # a single room: most of its floor
        free = areas > 0
        area = int(
            np.bincount(areas[free][_within(plan.rooms[0], grid.points(*np.nonzero(free)))], minlength=1).argmax()
        )
    rows, columns = np.nonzero(areas == area)
    points = grid.points(rows, columns)
    return all(_within(room, points).sum() * grid.resolution**2 >= _FREE_FLOOR for room in plan.rooms)
