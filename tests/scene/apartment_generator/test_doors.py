"""Doors in apartments: hung where they open freely, passable however they stand, and known to the map as doors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.navigation.global_planning.costmap import Costmap
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.scene.apartment_generator.generate import Apartment, at_nominal_pose, generate_apartment
from bestman_bt.scene.apartment_generator.options import ApartmentOptions
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.placing import articulation_outlines, standing_outlines
from bestman_bt.scene.plane_geometry import polygons_overlap, wall_rectangle
from bestman_bt.scene.scene import Wall, World
from bestman_bt.world_model.openness import articulation_obstacles
from bestman_bt.world_model.world_model import WorldModel

OPTIONS = ApartmentOptions(doors=1.0, half_open=0.5)
SEEDS = range(8)
BASE = Footprint(np.array([[-0.28, -0.26], [0.28, -0.26], [0.28, 0.26], [-0.28, 0.26]]))


@pytest.fixture(scope="module")
def apartments() -> list[Apartment]:
    return [generate_apartment(OPTIONS, seed) for seed in SEEDS]


@pytest.fixture(scope="module")
def world() -> World:
    return draw_world(load_scene("apartment_doors"), 3)


def walls_of(apartment: Apartment) -> list[Wall]:
    return [Wall(*line, OPTIONS.wall_height, OPTIONS.wall_thickness) for line in apartment.walls]


def test_every_doorway_has_a_door_as_wide_as_its_opening_and_some_stand_half_open(apartments: list[Apartment]) -> None:
    openings = []
    for apartment in apartments:
        assert len(apartment.doors) == len(apartment.doorways)
        for door, doorway in zip(apartment.doors, apartment.doorways, strict=True):
            assert door.at.xy == pytest.approx(doorway.at)
            assert door.model.footprint[1] == pytest.approx(doorway.width + 0.08)
            openings.append(math.degrees(door.open["door"]))
    half = [position for position in openings if position < 85.0]
    assert 0.25 < len(half) / len(openings) < 0.75
    assert all(66.0 <= position <= 80.0 for position in half)
    assert all(90.0 <= position <= 100.0 for position in openings if position >= 85.0)


@pytest.mark.slow
def test_doors_stand_in_nothing_and_leave_a_way_into_every_room(apartments: list[Apartment]) -> None:
    for apartment in apartments:
        walls, doors = walls_of(apartment), [at_nominal_pose(door) for door in apartment.doors]
        for door in doors:
            for outline in articulation_outlines(door):
                assert not any(polygons_overlap(outline, wall_rectangle(wall)) for wall in walls)
                assert not any(polygons_overlap(outline, piece.outline) for piece in apartment.furniture)
        floor = FloorGrid.of(standing_outlines(walls, [*map(at_nominal_pose, apartment.furniture), *doors]))
        points = floor.points(*np.nonzero(floor.largest_area(0.37)))
        for room in apartment.rooms:
            assert sum(room.contains(x, y) for x, y in points[::7]) > 20


def test_without_doors_an_apartment_is_what_it_was(apartments: list[Apartment]) -> None:
    plain = generate_apartment(ApartmentOptions(), 3)
    assert plain.doors == ()
    assert all(not doorway.has_door for doorway in plain.doorways)
    assert plain.walls != apartments[3].walls


def test_moved_doors_stand_otherwise_than_the_map_has_them() -> None:
    apartment = generate_apartment(replace(OPTIONS, moved_doors=1.0), 3)
    for mapped, now in zip(apartment.doors, apartment.doors_now, strict=True):
        assert mapped.at == now.at
        assert mapped.open != now.open


def test_the_robot_believes_doors_to_stand_as_the_map_has_them(world: World) -> None:
    doors = [piece for piece in world.furniture if piece.model.is_passage]
    believed = WorldModel(map=semantic_map(world))
    assert len(doors) >= 2
    for door in doors:
        assert believed.map.furniture[door.name].is_passage
        assert believed.map.furniture[door.name].pose == door.actual
        assert believed.articulations[f"{door.name}/door"] == pytest.approx(door.mapped_open["door"])


@pytest.mark.slow
def test_the_costmap_has_open_doors_where_they_stand_and_shut_ones_in_the_doorway(world: World) -> None:
    believed = WorldModel(map=semantic_map(world))
    door = next(piece for piece in world.furniture if piece.model.is_passage)
    (outline,) = articulation_outlines(door)

    def costmap() -> Costmap:
        return Costmap.from_map(believed.map, BASE, articulation_obstacles(believed))

    assert costmap().distance_at(outline.mean(axis=0)) < 0.0
    assert costmap().distance_at(door.actual.xy) > 0.3
    believed.articulations[f"{door.name}/door"] = 0.0
    in_frame = door.actual.to_pose().apply(np.array([[-0.07, 0.0, 0.0]]))[0, :2]
    assert costmap().distance_at(in_frame) < 0.0
    assert costmap().distance_at(outline.mean(axis=0)) > 0.05
