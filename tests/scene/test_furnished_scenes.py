"""The furnished kitchen and the cluttered table: they can be drawn, and things stand where there is room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.placing import planar_radius
from bestman_bt.scene.plane_geometry import distance_to_polygon, polygons_overlap, rectangle
from bestman_bt.scene.scene import World
from bestman_bt.scene.scene_config import SceneConfig

pytestmark = pytest.mark.slow

SEEDS = range(20)


@pytest.fixture(scope="module", params=["kitchen_furnished", "cluttered_table"])
def scene(request: pytest.FixtureRequest) -> SceneConfig:
    return load_scene(request.param)


@pytest.fixture(scope="module")
def furnished() -> list[World]:
    scene = load_scene("kitchen_furnished")
    return [draw_world(scene, seed) for seed in SEEDS]


def test_worlds_are_drawn_and_are_the_same_for_the_same_seed(scene: SceneConfig) -> None:
    for seed in SEEDS:
        first, second = draw_world(scene, seed), draw_world(scene, seed)
        assert first.robot_start == second.robot_start
        assert [o.name for o in first.objects] == [o.name for o in second.objects]
        for a, b in zip(first.objects, second.objects, strict=True):
            np.testing.assert_array_equal(a.pose.matrix, b.pose.matrix)


def test_objects_keep_their_distance_and_lie_on_their_surface(scene: SceneConfig) -> None:
    for seed in SEEDS:
        world = draw_world(scene, seed)
        pieces = {piece.name: piece for piece in world.furniture}
        for thing in world.objects:
            name, surface = scene.surface(scene.file.objects[thing.name].surface)
            on_surface = (pieces[name].pose @ surface.pose).inverse().apply(thing.pose.position[None])[0]
            assert np.all(np.abs(on_surface[:2]) <= np.array(surface.size) / 2 - planar_radius(thing.model) + 1e-9)
            assert on_surface[2] == pytest.approx(-float(thing.model.bounds()[0, 2]))
            for other in world.objects:
                apart = np.linalg.norm(other.pose.position - thing.pose.position)
                if other is not thing and abs(other.pose.position[2] - thing.pose.position[2]) < 0.1:
                    radii = planar_radius(other.model) + planar_radius(thing.model)
                    assert apart >= scene.file.clearance + radii - 1e-9


def test_the_cluttered_table_is_cluttered() -> None:
    scene = load_scene("cluttered_table")
    counts = [len(draw_world(scene, seed).objects) for seed in range(100)]
    assert np.mean([3 <= count <= 7 for count in counts]) > 0.8
    assert max(counts) >= 6


def test_the_microwave_stands_on_the_counter_as_that_really_stands(furnished: list[World]) -> None:
    for world in furnished:
        pieces = {piece.name: piece for piece in world.furniture}
        microwave, counter = pieces["microwave"], pieces["counter"]
        assert (microwave.on, microwave.elevation) == ("counter", 0.9)
        on_counter = counter.actual.inverse() @ microwave.actual
        assert [on_counter.x, on_counter.y] == pytest.approx([0.07, -0.52], abs=0.0101)
        corners = (counter.actual.inverse() @ microwave.actual).apply(rectangle(Pose2D(), microwave.model.footprint))
        assert np.all(np.abs(corners) <= np.array(counter.model.footprint) / 2)
        told = semantic_map(world).furniture["microwave"]
        assert told.height == pytest.approx(0.9 + 0.29)
        assert {s.name: round(float(s.pose.position[2]), 6) for s in told.surfaces}["top"] == pytest.approx(1.19)


def test_nothing_is_put_where_the_microwave_stands(furnished: list[World]) -> None:
    for world in furnished:
        microwave = next(piece for piece in world.furniture if piece.name == "microwave")
        outline = rectangle(microwave.actual, microwave.model.footprint)
        for thing in world.objects:
            if 0.9 < thing.pose.position[2] < 1.1:
                distance = distance_to_polygon(outline, thing.pose.position[:2])
                assert distance >= planar_radius(thing.model) + 0.08 - 1e-9
        assert distance_to_polygon(outline, world.goals["place"].position[:2]) >= 0.12


def test_furniture_on_the_floor_does_not_overlap(furnished: list[World]) -> None:
    for world in furnished:
        outlines = [rectangle(p.actual, p.model.footprint) for p in world.furniture if p.on is None]
        for i, outline in enumerate(outlines):
            assert not any(polygons_overlap(outline, other) for other in outlines[:i])


def test_the_map_reports_of_handles_only_how_far_they_protrude(furnished: list[World]) -> None:
    fridge = semantic_map(furnished[0]).furniture["fridge"]
    assert not [field for field in vars(fridge) if "handle" in field]
    assert fridge.articulations
    for door in fridge.articulations:
        assert [field for field in vars(door) if "handle" in field] == ["handle_depth"]


def test_things_on_two_boards_do_not_compete_for_room(furnished: list[World]) -> None:
    """Seen from above they may overlap: some do, in twenty worlds."""
    overlaps = 0
    for world in furnished:
        shelved = {o.name: o for o in world.objects if o.name in ("bottle", "soup_can", "cereal_box")}
        if "cereal_box" in shelved:
            box = shelved.pop("cereal_box")
            for thing in shelved.values():
                apart = np.linalg.norm(thing.pose.position[:2] - box.pose.position[:2])
                overlaps += apart < planar_radius(thing.model) + planar_radius(box.model) + 0.08
    assert overlaps > 0


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("on: conter/top", "furniture.oven.on: unknown surface 'conter/top'; did you mean 'counter/top'?"),
        ("on: oven/top", "furniture.oven.on: 'oven' should be named above what stands on it, got 'oven/top'"),
    ],
)
def test_furniture_that_stands_on_nothing_is_told_so(tmp_path: Path, line: str, message: str) -> None:
    path = tmp_path / "variant.yaml"
    path.write_text(f"extends: kitchen\nfurniture:\n  oven: {{model: microwave, at: [0, 0, 0], {line}}}\n")
    with pytest.raises(ConfigurationError) as error:
        load_scene(path)
    (problem,) = error.value.problems
    assert str(problem).endswith(f"variant.yaml:3: {message}")
