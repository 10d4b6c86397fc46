"""The scene ``apartment``: another one for each seed, checked as other scenes are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.plane_geometry import rectangle, wall_rectangle
from bestman_bt.scene.scene import World


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    scene = load_scene("apartment")
    return [draw_world(scene, seed) for seed in range(8)]


def test_each_seed_has_its_own_walls_and_the_map_knows_them_exactly(worlds: list[World]) -> None:
    assert len({world.walls for world in worlds}) == len(worlds)
    for world in worlds:
        ends = np.array([[*wall.start, *wall.end] for wall in world.walls])
        x_min, y_min = ends.reshape(-1, 2).min(axis=0)
        faces = semantic_map(world).walls
        assert faces[:, [0, 2]].min() == pytest.approx(x_min + 0.05)
        assert faces[:, [1, 3]].min() == pytest.approx(y_min + 0.05)


def test_the_map_has_furniture_where_it_should_stand(worlds: list[World]) -> None:
    for world in worlds:
        furniture = semantic_map(world).furniture
        assert set(furniture) == {piece.name for piece in world.furniture}
        for piece in world.furniture:
            assert furniture[piece.name].pose == piece.nominal
            assert 0.0 < piece.nominal.distance_to(piece.actual) <= np.hypot(0.03, 0.03)


def test_the_robot_starts_where_it_gets_everywhere_from(worlds: list[World]) -> None:
    for world in worlds:
        outlines = [wall_rectangle(wall) for wall in world.walls]
        outlines += [rectangle(piece.actual, piece.model.footprint) for piece in world.furniture]
        floor = FloorGrid.of(outlines)
        assert floor.largest_area(0.37)[floor.cells(world.robot_start.xy)]
        assert floor.room[floor.cells(world.robot_start.xy)] > 0.42


def test_one_apartment_can_be_kept_while_starts_vary() -> None:
    scene = load_scene("apartment", {"generator.apartment.seed": 3})
    first, second = draw_world(scene, 100), draw_world(scene, 101)
    assert first.walls == second.walls == draw_world(load_scene("apartment"), 3).walls
    assert [piece.nominal for piece in first.furniture] == [piece.nominal for piece in second.furniture]
    assert first.robot_start != second.robot_start


def test_things_may_stand_on_what_every_apartment_has(tmp_path: Path) -> None:
    path = tmp_path / "with_cup.yaml"
    path.write_text(
        "extends: apartment\nobjects:\n"
        "  cup: {model: cup, surface: table/top, region: {x: [-20 cm, 0], y: [0, 20 cm]}}\n"
    )
    (cup,) = draw_world(load_scene(path), 4).objects
    assert cup.pose.position[2] > 0.75


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("generator: {apartment: {rooms: [5, 3]}}", "generator.apartment.rooms: the smaller limit comes first"),
        ("generator: {apartment: {area: [60 m, 90 m]}}", "expected an area in m² (m², m^2), got '60 m'"),
        ("generator: {apartment: {room: 3}}", "unknown field; did you mean 'rooms'?"),
        ("furniture: {table: {model: table, at: [0, 0, 0]}}", "furniture: the generator makes them"),
    ],
)
def test_faults_are_reported_with_the_field(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "variant.yaml"
    path.write_text("extends: apartment\n" + text)
    with pytest.raises(ConfigurationError) as error:
        load_scene(path)
    assert message in str(error.value)


def test_a_scene_without_a_generator_owes_walls(tmp_path: Path) -> None:
    path = tmp_path / "bare.yaml"
    path.write_text("furniture: {}\nobjects: {}\nrobot_start: {x: [0, 1], y: [0, 1]}\n")
    with pytest.raises(ConfigurationError, match="walls: is missing"):
        load_scene(path)
