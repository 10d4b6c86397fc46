"""Apartments, whatever the seed: as asked, furnished, and passable everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from bestman_bt.scene.apartment_generator.generate import Apartment, ApartmentError, generate_apartment
from bestman_bt.scene.apartment_generator.options import ApartmentOptions
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.plane_geometry import polygons_overlap, wall_rectangle
from bestman_bt.scene.scene import Wall

pytestmark = pytest.mark.slow

SEEDS = range(25)
OPTIONS = ApartmentOptions()


@pytest.fixture(scope="module")
def apartments() -> list[Apartment]:
    return [generate_apartment(OPTIONS, seed) for seed in SEEDS]


def wall_outlines(apartment: Apartment) -> list[np.ndarray]:
    return [wall_rectangle(Wall(*line, OPTIONS.wall_height, OPTIONS.wall_thickness)) for line in apartment.walls]


def test_the_same_seed_makes_the_same_apartment_and_another_seed_another(apartments: list[Apartment]) -> None:
    again = generate_apartment(OPTIONS, 3)
    assert (again.walls, again.doorways) == (apartments[3].walls, apartments[3].doorways)
    assert [(p.name, p.at) for p in again.furniture] == [(p.name, p.at) for p in apartments[3].furniture]
    assert len({apartment.walls for apartment in apartments}) == len(SEEDS)


@pytest.mark.parametrize("rooms", [1, 2, 7, 12])
def test_apartments_have_as_many_rooms_as_asked_for_and_all_are_furnished(rooms: int) -> None:
    for seed in range(3):
        apartment = generate_apartment(ApartmentOptions(rooms=(rooms, rooms), area=(14.0 * rooms, 24.0 * rooms)), seed)
        assert (len(apartment.rooms), len(apartment.doorways) >= rooms - 1) == (rooms, True)
        assert {"table", "counter"} <= {piece.name for piece in apartment.furniture}
        assert all(any(room.contains(*piece.at.xy) for piece in apartment.furniture) for room in apartment.rooms)


def test_rooms_area_and_doorways_keep_to_the_limits(apartments: list[Apartment]) -> None:
    assert {len(apartment.rooms) for apartment in apartments} == {3, 4, 5, 6}
    for apartment in apartments:
        assert 60.0 - 1e-9 <= sum(room.area for room in apartment.rooms) <= 110.0 + 1e-9
        assert all(0.8 <= doorway.width <= 0.9 for doorway in apartment.doorways)
        assert min(min(room.size) for room in apartment.rooms) >= 2.6 - 1e-9


def test_walls_leave_each_doorway_as_wide_as_it_says(apartments: list[Apartment]) -> None:
    for apartment in apartments:
        floor = FloorGrid.of(wall_outlines(apartment), resolution=0.01)
        for doorway in apartment.doorways:
            assert floor.room[floor.cells(doorway.at)] == pytest.approx(doorway.width / 2, abs=0.015)


def test_furniture_stands_in_rooms_and_in_nothing_else(apartments: list[Apartment]) -> None:
    for apartment in apartments:
        walls, pieces = wall_outlines(apartment), apartment.furniture
        assert {"table", "counter"} <= {piece.name for piece in pieces}
        assert len({piece.name for piece in pieces}) == len(pieces) >= 8
        for index, piece in enumerate(pieces):
            assert any(room.contains(*piece.at.xy) for room in apartment.rooms)
            assert not any(polygons_overlap(piece.outline, wall) for wall in walls)
            assert not any(polygons_overlap(piece.outline, other.outline) for other in pieces[:index])


def test_a_disc_gets_from_every_room_into_every_other(apartments: list[Apartment]) -> None:
    for apartment in apartments:
        floor = FloorGrid.of([*wall_outlines(apartment), *(piece.outline for piece in apartment.furniture)])
        reachable = floor.largest_area(0.37)
        points = floor.points(*np.nonzero(reachable))
        for room in apartment.rooms:
            assert sum(room.contains(x, y) for x, y in points[::7]) > 20


def test_without_doorways_wide_enough_there_is_no_apartment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bestman_bt.scene.apartment_generator.generate._ATTEMPTS", 12)
    with pytest.raises(ApartmentError, match="no apartment in 12 draws"):
        generate_apartment(ApartmentOptions(rooms=(3, 3), doorway=(0.6, 0.6)), 0)
