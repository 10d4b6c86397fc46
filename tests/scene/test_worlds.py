"""Worlds drawn from the shipped scenes are sane, whatever the seed."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.messages import Pose2D
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import BaseModel
from bestman_bt.scene import draw
from bestman_bt.scene.draw import SceneError, draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.placing import planar_radius
from bestman_bt.scene.plane_geometry import (
    depth_inside,
    distance_to_polygon,
    polygons_overlap,
    rectangle,
    wall_rectangle,
)
from bestman_bt.scene.scene import World
from bestman_bt.scene.scene_config import SceneConfig

SEEDS = range(60)
SCENES = ("kitchen", "kitchen_without_cup", "kitchen_covered_counter")


@pytest.fixture(scope="module")
def scenes() -> dict[str, SceneConfig]:
    return {name: load_scene(name) for name in SCENES}


@pytest.fixture(scope="module")
def worlds(scenes: dict[str, SceneConfig]) -> dict[str, list[World]]:
    return {name: [draw_world(scene, seed) for seed in SEEDS] for name, scene in scenes.items()}


def furniture_outline(world: World, name: str) -> np.ndarray:
    piece = next(piece for piece in world.furniture if piece.name == name)
    return rectangle(piece.actual, piece.model.footprint)


def summary(world: World) -> list[tuple[str, list[float]]]:
    """A world as plain numbers, to compare."""
    furniture = [(f.name, [f.actual.x, f.actual.y, f.actual.theta]) for f in world.furniture]
    objects = [(o.name, [*o.pose.position, *o.pose.quaternion]) for o in world.objects]
    goals = [(name, [*pose.position, *pose.quaternion]) for name, pose in world.goals.items()]
    start = world.robot_start
    return [*furniture, *objects, *goals, ("start", [start.x, start.y, start.theta])]


def test_the_same_seed_draws_the_same_world(scenes: dict[str, SceneConfig]) -> None:
    for seed in (0, 1, 1000):
        first, second = (summary(draw_world(scenes["kitchen"], seed)) for _ in range(2))
        assert [name for name, _ in first] == [name for name, _ in second]
        assert all(a == b for (_, a), (_, b) in zip(first, second, strict=True))


@pytest.mark.slow
def test_other_seeds_draw_other_worlds(worlds: dict[str, list[World]]) -> None:
    assert len({tuple(dict(summary(world))["cup"]) for world in worlds["kitchen"]}) == len(SEEDS)
    assert len({tuple(sorted(o.name for o in world.objects)) for world in worlds["kitchen"]}) >= 8


@pytest.mark.slow
def test_objects_leave_room_for_a_hand(worlds: dict[str, list[World]]) -> None:
    for world in worlds["kitchen"]:
        for a, b in itertools.combinations(world.objects, 2):
            gap = np.linalg.norm(a.pose.position[:2] - b.pose.position[:2])
            assert gap >= planar_radius(a.model) + planar_radius(b.model) + 0.08


@pytest.mark.slow
def test_objects_never_overlap_even_where_they_are_packed(worlds: dict[str, list[World]]) -> None:
    for world in worlds["kitchen_covered_counter"]:
        outlines = [rectangle(o.pose.to_pose2d(), (o.model.size[0], o.model.size[1])) for o in world.objects]
        assert not any(polygons_overlap(a, b) for a, b in itertools.combinations(outlines, 2))


@pytest.mark.parametrize("name", SCENES)
def test_objects_stand_on_their_surface_and_inside_it(
    scenes: dict[str, SceneConfig], worlds: dict[str, list[World]], name: str
) -> None:
    for world in worlds[name]:
        for thing in world.objects:
            furniture, surface = scenes[name].surface(scenes[name].file.objects[thing.name].surface)
            bottom = thing.pose.position[2] + thing.model.bounds()[0, 2]
            assert bottom == pytest.approx(surface.pose.position[2], abs=1e-9)
            outline = furniture_outline(world, furniture)
            corners = rectangle(thing.pose.to_pose2d(), (thing.model.size[0], thing.model.size[1]))
            if thing.model.symmetry_order == 0:
                assert depth_inside(outline, thing.pose.position[:2]) >= planar_radius(thing.model) - 1e-9
            else:
                assert min(depth_inside(outline, corner) for corner in corners) >= -1e-9


def test_the_cup_is_always_within_reach_of_the_tables_front(worlds: dict[str, list[World]]) -> None:
    for world in worlds["kitchen"]:
        cup = next(o for o in world.objects if o.name == "cup")
        table = next(f for f in world.furniture if f.name == "table")
        in_table = table.actual.inverse().apply(cup.pose.position[:2])
        assert 0.10 <= in_table[0] + 0.40 <= 0.30


def test_furniture_stands_within_three_centimetres_and_two_degrees_of_the_map(worlds: dict[str, list[World]]) -> None:
    offsets = np.array(
        [
            [f.actual.x - f.nominal.x, f.actual.y - f.nominal.y, f.actual.theta - f.nominal.theta]
            for world in worlds["kitchen"]
            for f in world.furniture
        ]
    )
    limits = np.array([0.03, 0.03, math.radians(2.0)])
    assert np.all(np.abs(offsets) <= limits)
    assert np.all(np.abs(offsets).max(axis=0) > 0.9 * limits)


def test_furniture_stands_clear_of_the_walls_and_of_each_other(worlds: dict[str, list[World]]) -> None:
    for world in worlds["kitchen"]:
        outlines = [furniture_outline(world, f.name) for f in world.furniture]
        others = [*outlines, *(wall_rectangle(wall) for wall in world.walls)]
        for i, outline in enumerate(outlines):
            assert not any(polygons_overlap(outline, other) for j, other in enumerate(others) if j != i)


@pytest.mark.parametrize("name", ["kitchen", "kitchen_without_cup"])
def test_the_goal_is_ten_centimetres_inside_the_counter_and_free(worlds: dict[str, list[World]], name: str) -> None:
    for world in worlds[name]:
        counter = next(f for f in world.furniture if f.name == "counter")
        goal = world.goals["place"]
        for pose in (counter.actual, counter.nominal):
            assert depth_inside(rectangle(pose, counter.model.footprint), goal.position[:2]) >= 0.10
        assert goal.position[2] == pytest.approx(0.90 + 0.05)
        for thing in world.objects:
            gap = float(np.linalg.norm(thing.pose.position[:2] - goal.position[:2]))
            assert gap >= 0.033 + planar_radius(thing.model) + 0.12


def test_the_goal_is_within_reach_of_the_counters_front(worlds: dict[str, list[World]]) -> None:
    for world in worlds["kitchen"]:
        counter = next(f for f in world.furniture if f.name == "counter")
        from_front = counter.actual.inverse().apply(world.goals["place"].position[:2])[0] + 0.30
        assert 0.10 <= from_front <= 0.30


def test_the_robot_starts_free_of_walls_and_furniture(worlds: dict[str, list[World]]) -> None:
    footprint = np.array(load_robot_model("diff_panda").of(BaseModel)["base"].footprint)
    for world in worlds["kitchen"]:
        body = world.robot_start.apply(footprint)
        obstacles = [wall_rectangle(wall) for wall in world.walls]
        obstacles += [furniture_outline(world, f.name) for f in world.furniture]
        assert not any(polygons_overlap(body, obstacle) for obstacle in obstacles)
        assert min(distance_to_polygon(obstacle, world.robot_start.xy) for obstacle in obstacles) >= 0.45


def test_the_doorway_lets_the_robot_through_with_room_to_spare(worlds: dict[str, list[World]]) -> None:
    footprint = np.array(load_robot_model("diff_panda").of(BaseModel)["base"].footprint)
    radius = float(np.linalg.norm(footprint, axis=1).max())
    walls = [wall_rectangle(wall) for wall in worlds["kitchen"][0].walls]
    assert min(distance_to_polygon(wall, np.zeros(2)) for wall in walls) >= radius + 0.2


def test_without_the_cup_everything_else_stays_where_it_is(worlds: dict[str, list[World]]) -> None:
    without = worlds["kitchen_without_cup"]
    assert all(o.name != "cup" for world in without for o in world.objects)
    assert all("place" in world.goals for world in without)
    same = sum(
        [o.pose.position.tolist() for o in a.objects if o.name != "cup"]
        == [o.pose.position.tolist() for o in b.objects]
        for a, b in zip(worlds["kitchen"], without, strict=True)
    )
    assert same > 0.5 * len(SEEDS)


@pytest.mark.slow
def test_no_disc_of_twelve_centimetres_is_free_on_the_covered_counter(worlds: dict[str, list[World]]) -> None:
    world = worlds["kitchen_covered_counter"][0]
    counter = next(f for f in world.furniture if f.name == "counter")
    outlines = [
        rectangle(counter.actual.inverse() @ o.pose.to_pose2d(), (o.model.size[0], o.model.size[1]))
        for o in world.objects
        if o.name.startswith("crate")
    ]
    surface = rectangle(Pose2D(), counter.model.footprint)
    free_radii = [
        min([depth_inside(surface, point), *(distance_to_polygon(outline, point) for outline in outlines)])
        for point in itertools.product(np.arange(-0.3, 0.301, 0.03), np.arange(-0.8, 0.801, 0.03))
        for point in [np.array(point)]
    ]
    assert max(free_radii) < 0.06
    assert max(free_radii) > 0.03  # the counter itself can still be seen between the objects


OBJECT_IN_THE_WAY = """extends: kitchen
objects:
  cup: {model: cup, surface: table/top, region: {x: [0.0, 0.01], y: [0.0, 0.01]}, presence: 1}
  can:
    model: can
    surface: table/top
    presence: 1
    region:
      x: [0.0, 0.01]
      y: [0.0, 0.01]
"""


@pytest.mark.parametrize(
    ("text", "overrides", "told"),
    [
        (OBJECT_IN_THE_WAY, {}, r"mine.yaml:9: objects.can.region.x: no room for 'can' on table/top beside cup in any"),
        ("extends: kitchen\nrobot_start:\n  x: [2.5, 2.5]\n  y: [0, 0]\n", {}, r"mine.yaml:3: robot_start.x: no room"),
        (
            "extends: kitchen\n",
            {"goals.place.margin": 0.35},
            r"kitchen.yaml:\d+: goals.place.region.x: no room for the goal 'place' on counter/top in any of",
        ),
    ],
)
def test_a_world_that_cannot_be_drawn_is_reported_with_the_line_and_the_thing_that_does_not_fit(
    text: str, overrides: dict[str, Any], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(draw, "_ATTEMPTS", 3)
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(SceneError, match=told):
        draw_world(load_scene(path, overrides), 1)
