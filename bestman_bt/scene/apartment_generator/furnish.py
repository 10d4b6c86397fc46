"""Furniture for rooms: pieces along the walls, a table with chairs in the middle, and free doorways."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from bestman_bt.messages import Pose2D
from bestman_bt.scene.apartment_generator.floor_plan import Doorway, FloorPlan, Room
from bestman_bt.scene.apartment_generator.options import ApartmentPiece
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.furniture_generator.generate import FURNITURE_KINDS, generate_furniture
from bestman_bt.scene.scene import FurnitureModel

OFFSET, TURN = 0.03, math.radians(2.0)
"""Largest error of the mapped pose of furniture: metres each way, radians."""
NEEDED = ("table", "counter")
"""Furniture that every apartment has once, so that tasks can name it."""

_TRIES = 60
_BEFORE_DOORWAY = 0.85  # metres that are kept free on both sides
_BESIDE_DOORWAY = 0.10
_BEFORE_DOOR, _BESIDE_DOOR = 1.10, 0.30  # where a door swings
_APART = 0.08
_CHAIR_GAP = 0.06
_Extent = tuple[float, float, float, float]  # x and y of the lower corner, x and y of the upper one


@dataclass(frozen=True)
class _Furnishing:
    """The furniture of a room.

    ``walls``: pieces with their backs to a wall; ``dining``: a table with chairs around it.
    """

    walls: tuple[str, ...]
    dining: bool = False


_STUDIO = _Furnishing(("counter", "fridge", "bed"), dining=True)
_KITCHEN = _Furnishing(("counter", "fridge", "shelf"))
_LIVING = _Furnishing(("sofa", "drawer_chest", "shelf"), dining=True)
_OTHERS = (
    _Furnishing(("bed", "drawer_chest")),
    _Furnishing(("desk", "shelf", "chair")),
    _Furnishing(("bed", "shelf", "chair")),
    _Furnishing(("sofa", "shelf", "desk")),
)
_SHIPPED = {"desk": "table"}


@dataclass
class _Furnisher:
    rng: np.random.Generator
    wall_thickness: float
    taken: list[_Extent]
    placed: list[ApartmentPiece] = field(default_factory=list)

    def along_walls(self, room: Room, kind: str) -> bool:
        """Put a piece with its back to one of the walls; return False if it fits nowhere."""
        model = self._model(kind)
        depth, width = model.footprint
        back = OFFSET + width / 2 * math.sin(TURN) + 0.01 + self.wall_thickness / 2 + depth / 2
        for _ in range(_TRIES):
            side, share = int(self.rng.integers(4)), float(self.rng.random())
            along, across = (room.y, room.x) if side % 2 == 0 else (room.x, room.y)
            margin = width / 2 + self.wall_thickness / 2 + OFFSET + depth / 2 * math.sin(TURN) + 0.01
            if along[1] - along[0] <= 2 * margin:
                continue
            place = along[0] + margin + share * (along[1] - along[0] - 2 * margin)
            wall = across[1] - back if side < 2 else across[0] + back
            x, y = (wall, place) if side % 2 == 0 else (place, wall)
            if self._put(kind, model, Pose2D(x, y, side * math.pi / 2)):
                return True
        return False

    def dining_group(self, room: Room) -> bool:
        """Put a table into the room, and chairs that face it."""
        table, chair = self._model("table"), self._model("chair")
        reach = max(table.footprint) / 2 + chair.footprint[0] + _CHAIR_GAP
        spans = [(low + reach + 0.1, high - reach - 0.1) for low, high in (room.x, room.y)]
        if any(low > high for low, high in spans):
            return False
        for _ in range(_TRIES):
            (x, y) = (float(self.rng.uniform(*span)) for span in spans)
            at = Pose2D(x, y, float(self.rng.integers(2)) * math.pi / 2)
            if self._put("table", table, at):
                for index in self.rng.permutation(4)[: int(self.rng.integers(1, 5))]:
                    turn = Pose2D(0.0, 0.0, float(index) * math.pi / 2)
                    away = table.footprint[index % 2] / 2 + _CHAIR_GAP + chair.footprint[0] / 2
                    self._put("chair", chair, at @ turn @ Pose2D(away, 0.0, 0.0), gap=0.0)
                return True
        return False

    def _model(self, kind: str) -> FurnitureModel:
        if kind in FURNITURE_KINDS:
            return generate_furniture(kind, self.rng)
        return read_furniture(_SHIPPED.get(kind, kind))

    def _put(self, kind: str, model: FurnitureModel, at: Pose2D, gap: float = _APART) -> bool:
        west, south, east, north = extent = _extent(at, model.footprint)
        for x_min, y_min, x_max, y_max in self.taken:
            if west - gap < x_max and x_min < east + gap and south - gap < y_max and y_min < north + gap:
                return False
        same = sum(placed.name.rstrip("_0123456789") == kind for placed in self.placed)
        self.placed.append(ApartmentPiece(f"{kind}_{same + 1}" if same else kind, model, at))
        self.taken.append(extent)
        return True


def furnish(plan: FloorPlan, wall_thickness: float, rng: np.random.Generator) -> list[ApartmentPiece] | None:
    """Return furniture for all rooms, the largest first, or None if a required piece found no place."""
    furnisher = _Furnisher(rng, wall_thickness, [*_before_doorways(plan.doorways, wall_thickness)])
    rooms = sorted(plan.rooms, key=lambda room: -room.area)
    for room, furnishing in zip(rooms, _furnishings(len(rooms), rng), strict=True):
        if furnishing.dining and not furnisher.dining_group(room):
            return None
        for kind in furnishing.walls:
            if not furnisher.along_walls(room, kind) and kind in NEEDED:
                return None
    return furnisher.placed


def _furnishings(count: int, rng: np.random.Generator) -> list[_Furnishing]:
    """Return the furnishing of each room: a single room is a studio; of many, each other kind occurs before one
    repeats.
    """
    if count == 1:
        return [_STUDIO]
    others = itertools.cycle([_OTHERS[index] for index in rng.permutation(len(_OTHERS))])
    return [_LIVING, _KITCHEN, *itertools.islice(others, count - 2)]


def _before_doorways(doorways: Iterable[Doorway], wall_thickness: float) -> Iterator[_Extent]:
    for doorway in doorways:
        before, beside = (_BEFORE_DOOR, _BESIDE_DOOR) if doorway.has_door else (_BEFORE_DOORWAY, _BESIDE_DOORWAY)
        deep, wide = wall_thickness + 2 * before, doorway.width + 2 * beside
        yield _extent(Pose2D(*doorway.at, 0.0), (wide, deep) if doorway.along == 0 else (deep, wide))


def _extent(at: Pose2D, size: tuple[float, float]) -> _Extent:
    """Return the extent of a rectangle that is turned by a multiple of a right angle."""
    x, y = size if abs(math.cos(at.theta)) > 0.5 else size[::-1]
    return at.x - x / 2, at.y - y / 2, at.x + x / 2, at.y + y / 2
