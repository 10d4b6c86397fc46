"""One apartment: plans and furnishings are drawn until a robot gets everywhere."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bestman_bt.errors import Error
from bestman_bt.scene.apartment_generator.doors import POST, as_standing, hang_doors, moved_doors
from bestman_bt.scene.apartment_generator.floor_plan import Doorway, FloorPlan, Line, Room, floor_plan
from bestman_bt.scene.apartment_generator.furnish import OFFSET, TURN, furnish
from bestman_bt.scene.apartment_generator.options import ApartmentOptions
from bestman_bt.scene.apartment_generator.placed import Placed
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.plane_geometry import rectangle, wall_rectangle
from bestman_bt.scene.scene import Wall
from bestman_bt.scene.standing_outlines import standing_outlines

_ATTEMPTS = 400
_FREE_FLOOR = 0.5
"""Square metres of each room, at least, that the middle of a robot can be at."""


class ApartmentError(Error, RuntimeError):
    """The options leave no room for an apartment."""


@dataclass(frozen=True)
class Apartment:
    """``walls``: ends of centre lines in the map frame, whose origin is in the middle. ``furniture``: as mapped.

    ``doors``: as mapped; ``doors_now``: as they really stand open.
    """

    rooms: tuple[Room, ...]
    doorways: tuple[Doorway, ...]
    walls: tuple[Line, ...]
    furniture: tuple[Placed, ...]
    doors: tuple[Placed, ...] = ()
    doors_now: tuple[Placed, ...] = ()


def generate_apartment(options: ApartmentOptions, seed: int, passage: float = 0.37) -> Apartment:
    """The apartment of a seed; ApartmentError where none comes about.

    Every room can be reached from every other one by a disc of the radius ``passage``, metres, wherever between its
    limits the furniture really stands, and however its doors stand open.
    """
    for attempt in range(_ATTEMPTS):
        rng, door_rng = np.random.default_rng([seed, attempt]), np.random.default_rng([seed, attempt, 1])
        plan = floor_plan(options, rng, door_rng, POST)
        furniture = furnish(plan, options.wall_thickness, rng) if plan is not None else None
        if plan is None or furniture is None:
            continue
        doors = hang_doors(plan, furniture, options, door_rng)
        if doors is None:
            continue
        now = moved_doors(doors, options, door_rng)
        if all(_is_connected(plan, furniture, hung, options, passage) for hung in (doors, now)):
            return Apartment(plan.rooms, plan.doorways, plan.walls, tuple(furniture), tuple(doors), tuple(now))
    raise ApartmentError(f"no apartment in {_ATTEMPTS} draws with {options}, seed {seed}")


def _is_connected(
    plan: FloorPlan, furniture: list[Placed], doors: list[Placed], options: ApartmentOptions, passage: float
) -> bool:
    """Whether all doorways and enough floor of each room belong to one area."""
    outlines = [wall_rectangle(Wall(*line, options.wall_height, options.wall_thickness)) for line in plan.walls]
    for piece in furniture:
        depth, width = piece.model.footprint
        grown = (depth + 2 * OFFSET + width * TURN, width + 2 * OFFSET + depth * TURN)
        outlines.append(rectangle(piece.at, grown))
    outlines += standing_outlines((), map(as_standing, doors))
    grid = FloorGrid.of(outlines)
    areas = grid.areas(passage)
    at_doorways = areas[grid.cells([doorway.at for doorway in plan.doorways])]
    if not np.all((at_doorways == at_doorways[0]) & (at_doorways > 0)):
        return False
    rows, columns = np.nonzero(areas == at_doorways[0])
    points = grid.points(rows, columns)
    for room in plan.rooms:
        inside = np.all((points >= (room.x[0], room.y[0])) & (points <= (room.x[1], room.y[1])), axis=1)
        if inside.sum() * grid.resolution**2 < _FREE_FLOOR:
            return False
    return True
