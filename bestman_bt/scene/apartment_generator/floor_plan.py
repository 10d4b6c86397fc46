"""Floor plans: a rectangle that is split into rooms recursively, and doorways between neighbours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bestman_bt.scene.apartment_generator.options import ApartmentOptions

Line = tuple[tuple[float, float], tuple[float, float]]

_LARGEST_ASPECT = 1.5
_ROOM_AREA = (14.0, 24.0)
_SHORTEST_SIDE = 2.6
_BESIDE_DOORWAY = 0.35  # metres of wall on each side


@dataclass(frozen=True)
class Room:
    """A rectangle between the centre lines of its walls, metres in the map frame."""

    x: tuple[float, float]
    y: tuple[float, float]

    @property
    def size(self) -> tuple[float, float]:
        """Extents along x and y, metres."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]

    @property
    def area(self) -> float:
        """Floor area, square metres."""
        return self.size[0] * self.size[1]

    def contains(self, x: float, y: float) -> bool:
        """Return whether the point (x, y), metres, lies in the room."""
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]


@dataclass(frozen=True)
class Doorway:
    """An opening of ``width`` metres at ``at`` in the wall between two ``rooms``, given by index.

    ``along``: 0 for a wall along x, 1 along y. ``frame``: metres of a door's frame on each side, beyond the width; 0
    without a door.
    """

    at: tuple[float, float]
    along: int
    width: float
    rooms: tuple[int, int]
    frame: float = 0.0

    @property
    def has_door(self) -> bool:
        """Return whether the doorway has a door."""
        return self.frame > 0.0

    @property
    def opening(self) -> float:
        """The distance between the walls, metres."""
        return self.width + 2.0 * self.frame


@dataclass(frozen=True)
class FloorPlan:
    """A floor plan. ``walls``: the ends of their centre lines, interrupted by doorways."""

    rooms: tuple[Room, ...]
    doorways: tuple[Doorway, ...]
    walls: tuple[Line, ...]


def floor_plan(
    options: ApartmentOptions, rng: np.random.Generator, door_rng: np.random.Generator, frame: float
) -> FloorPlan | None:
    """Draw a floor plan around the origin, or None if the draw failed.

    ``door_rng``: decides which doorways get a door; ``frame``: width of the door's frame on each side.
    """
    count = int(rng.integers(options.rooms[0], options.rooms[1] + 1))
    area = float(np.clip(count * rng.uniform(*_ROOM_AREA), *options.area))
    aspect = float(rng.uniform(1.0, _LARGEST_ASPECT))
    width, depth = (area * aspect) ** 0.5, (area / aspect) ** 0.5
    rooms = [Room((-width / 2, width / 2), (-depth / 2, depth / 2))]
    partitions: list[Line] = []
    while len(rooms) < count:
        largest = max(range(len(rooms)), key=lambda index: rooms[index].area)
        split = _split(rooms.pop(largest), rng)
        if split is None:
            return None
        first, second, line = split
        rooms += [first, second]
        partitions.append(line)
    doorways = _doorways(rooms, options, rng)
    if doorways is None:
        return None
    doorways = [replace(d, frame=frame) if door_rng.random() < options.doors else d for d in doorways]
    outside = rooms_around(rooms)
    walls = [*outside, *(piece for line in partitions for piece in _opened(line, doorways, options.wall_thickness))]
    return FloorPlan(tuple(rooms), tuple(doorways), tuple(walls))


def rooms_around(rooms: Sequence[Room]) -> list[Line]:
    """Return the outer walls of a rectangle of rooms."""
    x = min(room.x[0] for room in rooms), max(room.x[1] for room in rooms)
    y = min(room.y[0] for room in rooms), max(room.y[1] for room in rooms)
    corners = [(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])]
    return list(zip(corners, [*corners[1:], corners[0]], strict=True))


def _split(room: Room, rng: np.random.Generator) -> tuple[Room, Room, Line] | None:
    """Return a room cut in two across its longer side, and the wall between them."""
    width, depth = room.size
    share = float(rng.uniform(0.36, 0.64))
    longer = max(width, depth)
    if min(share, 1.0 - share) * longer < _SHORTEST_SIDE or min(width, depth) < _SHORTEST_SIDE:
        return None
    if width >= depth:
        x = room.x[0] + share * width
        return Room((room.x[0], x), room.y), Room((x, room.x[1]), room.y), ((x, room.y[0]), (x, room.y[1]))
    y = room.y[0] + share * depth
    return Room(room.x, (room.y[0], y)), Room(room.x, (y, room.y[1])), ((room.x[0], y), (room.x[1], y))


def _doorways(rooms: Sequence[Room], options: ApartmentOptions, rng: np.random.Generator) -> list[Doorway] | None:
    """Return a tree of doorways over all rooms, and sometimes one more, or None if a room cannot have any."""
    group = list(range(len(rooms)))
    walls = list(_common_walls(rooms))
    doorways = []
    for index in rng.permutation(len(walls)):
        first, second, along, across, span = walls[index]
        width = float(rng.uniform(*options.doorway))
        place, wanted = float(rng.random()), bool(rng.random() < options.loops)
        margin = width / 2 + options.wall_thickness / 2 + _BESIDE_DOORWAY
        if span[1] - span[0] < 2 * margin or (group[first] == group[second] and not wanted):
            continue
        middle = span[0] + margin + place * (span[1] - span[0] - 2 * margin)
        at = (middle, across) if along == 0 else (across, middle)
        doorways.append(Doorway(at, along, width, (first, second)))
        group = [group[first] if member == group[second] else member for member in group]
    return doorways if len(set(group)) == 1 else None


def _common_walls(rooms: Sequence[Room]) -> Iterator[tuple[int, int, int, float, tuple[float, float]]]:
    """Yield pairs of neighbours, the axis along which their wall runs, its position across it, and its extent."""
    for first, a in enumerate(rooms):
        for second, b in enumerate(rooms):
            for along, (across_a, across_b, span_a, span_b) in enumerate(((a.y, b.y, a.x, b.x), (a.x, b.x, a.y, b.y))):
                span = max(span_a[0], span_b[0]), min(span_a[1], span_b[1])
                if across_a[1] == across_b[0] and span[0] < span[1]:
                    yield first, second, along, across_a[1], span


def _opened(line: Line, doorways: Sequence[Doorway], thickness: float) -> Iterator[Line]:
    """Yield the pieces of a wall beside its doorways; walls reach half their thickness beyond their ends."""
    start, end = line
    along = 0 if start[1] == end[1] else 1
    across, here, last = start[1 - along], start[along], end[along]
    openings = sorted(
        (door.at[along] - door.opening / 2 - thickness / 2, door.at[along] + door.opening / 2 + thickness / 2)
        for door in doorways
        if door.along == along and door.at[1 - along] == across and here < door.at[along] < last
    )
    for opening in (*openings, (last, last)):
        piece = ((here, across), (opening[0], across)) if along == 0 else ((across, here), (across, opening[0]))
        yield piece
        here = opening[1]
