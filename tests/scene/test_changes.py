"""What has changed since the map was made: the world has it, the map does not."""

from __future__ import annotations

import math

import numpy as np
import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.messages import Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.floor_grid import FloorGrid
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.plane_geometry import polygons_overlap, rectangle, wall_rectangle
from bestman_bt.scene.scene import World

CHAIRS = ("chair_1", "chair_2", "chair_3")


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    scene = load_scene("kitchen_with_chairs")
    return [draw_world(scene, seed) for seed in range(6)]


def floor_of(world: World, without: tuple[str, ...] = ()) -> FloorGrid:
    outlines = [wall_rectangle(wall) for wall in world.walls]
    outlines += [rectangle(f.actual, f.model.footprint) for f in world.furniture if f.name not in without]
    return FloorGrid.of(outlines)


def test_the_chairs_stand_there_and_the_map_does_not_have_them(worlds: list[World]) -> None:
    for world in worlds:
        assert set(CHAIRS) <= {piece.name for piece in world.furniture}
        assert not set(CHAIRS) & set(semantic_map(world).furniture)


def test_all_else_is_as_without_the_chairs(worlds: list[World]) -> None:
    kitchen = load_scene("kitchen")
    for seed, world in enumerate(worlds):
        plain = draw_world(kitchen, seed)
        assert world.robot_start == plain.robot_start
        assert [(o.name, *o.pose.position) for o in world.objects] == [
            (o.name, *o.pose.position) for o in plain.objects
        ]
        assert [piece.actual for piece in world.furniture if piece.mapped] == [p.actual for p in plain.furniture]


def test_chairs_stand_in_nothing_and_cut_nothing_off(worlds: list[World]) -> None:
    for world in worlds:
        chairs = [piece for piece in world.furniture if not piece.mapped]
        outlines = [rectangle(chair.actual, chair.model.footprint) for chair in chairs]
        others = [wall_rectangle(wall) for wall in world.walls]
        others += [rectangle(piece.actual, piece.model.footprint) for piece in world.furniture if piece.mapped]
        for index, outline in enumerate(outlines):
            assert not any(polygons_overlap(outline, other) for other in (*others, *outlines[:index]))
        before, after = floor_of(world, without=CHAIRS), floor_of(world)
        lost = before.largest_area(0.37) & ~after.largest_area(0.37) & (after.room > 0.37)
        assert not lost.any()
        assert after.room[after.cells(world.robot_start.xy)] > 0.45


@pytest.mark.slow
def test_a_chair_of_an_apartment_may_have_been_moved_while_the_map_has_it_where_it_was() -> None:
    scene = load_scene("apartment", {"generator.apartment.moved_chairs": 1.0})
    far = []
    for seed in range(4):
        world = draw_world(scene, seed)
        known = semantic_map(world).furniture
        for piece in world.furniture:
            assert known[piece.name].pose == piece.nominal
            off = np.abs(piece.actual.xy - piece.nominal.xy).max()
            assert off <= (0.6 if piece.model.name == "chair" else 0.03)
            if piece.model.name == "chair":
                far.append(off)
    assert len(far) >= 4
    assert np.median(far) > 0.15


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("seed", [21006, 21011])
def test_a_chair_that_stood_in_a_narrow_place_is_moved_and_cuts_off_no_more_than_before(seed: int) -> None:
    world = draw_world(load_scene("apartment_walkers"), seed)
    moved = [piece for piece in world.furniture if piece.nominal.distance_to(piece.actual) > 0.05]
    assert moved
    still = [wall_rectangle(wall) for wall in world.walls]
    still += [rectangle(piece.actual, piece.model.footprint) for piece in world.furniture if piece not in moved]
    for piece in moved:
        places = (piece.nominal, piece.actual)
        before, after = (FloorGrid.of([*still, rectangle(place, piece.model.footprint)]) for place in places)
        lost = before.largest_area(0.37) & ~after.largest_area(0.37) & (after.room > 0.37)
        assert lost.sum() * after.resolution**2 < 0.02  # it stood within 3 cm of where the map has it


def test_a_piece_that_was_moved_is_no_farther_from_where_the_map_has_it_than_it_may_be() -> None:
    scene = load_scene("chest_room", {f"furniture.drawer_chest.{field}": 0.3 for field in ("offset", "moved")})
    for seed in range(12):
        chest = next(piece for piece in draw_world(scene, seed).furniture if piece.name == "drawer_chest")
        assert np.abs(chest.actual.xy - chest.nominal.xy).max() <= 0.3


def test_one_outline_more_is_measured_as_if_all_were_measured_anew() -> None:
    rng = np.random.default_rng(1)
    walls = [wall_rectangle(wall) for wall in draw_world(load_scene("kitchen"), 0).walls]
    floor = FloorGrid.of(walls)
    for _ in range(10):
        piece = rectangle(Pose2D(*rng.uniform((-3.0, -1.5, -3.0), (3.5, 1.5, 3.0))), (0.4, 0.5))
        anew, beside = FloorGrid.of([*walls, piece]).room, floor.beside(piece, 0.4).room
        assert np.array_equal(anew > 0.4, beside > 0.4)
        assert np.array_equal(anew[anew <= 0.4], beside[anew <= 0.4])


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_coarse_cell_has_the_room_of_the_fine_cell_that_holds_its_middle(count: int) -> None:
    fine = FloorGrid(np.arange(240.0).reshape(12, 20), np.array([-1.0, 2.0]), 0.1)
    coarse = fine.every(count)
    rows, columns = np.indices(coarse.room.shape)
    middles = coarse.points(rows, columns)
    np.testing.assert_allclose(middles, fine.points(rows * count + count // 2, columns * count + count // 2))
    np.testing.assert_array_equal(coarse.room, fine.room[fine.cells(middles)])


@pytest.mark.slow
def test_presence_decides_whether_a_piece_came() -> None:
    scene = load_scene("kitchen_with_chairs", {"unmapped.chair_1.presence": 0.5})
    there = [any(piece.name == "chair_1" for piece in draw_world(scene, seed).furniture) for seed in range(24)]
    assert 4 < sum(there) < 20


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"unmapped.chair_1.model": "chiar"}, "unknown furniture 'chiar'; did you mean 'chair'?"),
        ({"unmapped.chair_1.region.x": ["1 m", "-1 m"]}, "unmapped.chair_1.region.x: the smaller limit comes first"),
        ({"walkers": {"count": 0}}, "walkers.count"),
        ({"walkers": {"count": 1, "speed": ["1 m/s", "0.5 m/s"]}}, "walkers.speed: the smaller limit comes first"),
    ],
)
def test_faults_are_reported_with_the_field(overrides: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigurationError) as error:
        load_scene("kitchen_with_chairs", overrides)
    assert message in str(error.value)


@pytest.mark.slow
def test_walkers_have_rounds_on_the_free_floor_away_from_the_robot() -> None:
    scene = load_scene("apartment_walkers")
    for seed in range(3):
        world = draw_world(scene, seed)
        floor = floor_of(world)
        assert [walker.name for walker in world.walkers] == [f"walker_{number}" for number in range(1, 6)]
        for walker in world.walkers:
            route = np.array(walker.route)
            assert floor.room[floor.cells(route)].min() > walker.radius
            steps = np.linalg.norm(route - np.roll(route, 1, axis=0), axis=1)
            assert steps.max() <= 0.1 * math.sqrt(2.0) + 1e-9
            assert 0.3 <= walker.speed <= 0.8
            assert math.dist(walker.route[0], world.robot_start.xy) >= 1.2


def test_way_points_may_be_given() -> None:
    points = [["-3 m", "-1.5 m"], ["3.5 m", "1.5 m"]]
    (walker,) = draw_world(load_scene("kitchen", {"walkers": {"count": 1, "way_points": points}}), 0).walkers
    route = np.array(walker.route)
    for x, y in ((-3.0, -1.5), (3.5, 1.5)):
        assert np.linalg.norm(route - (x, y), axis=1).min() < 0.1


def test_a_door_that_was_hung_stands_half_open_and_the_robot_does_not_start_in_it() -> None:
    scene = load_scene("kitchen_half_open_door")
    starts = []
    for seed in range(30):
        world = draw_world(scene, seed)
        (door,) = (piece for piece in world.furniture if not piece.mapped)
        assert door.open == {"door": pytest.approx(math.radians(75.0))}
        assert "new_door" not in semantic_map(world).furniture
        panel = door.model.articulations[0]
        ends = (door.pose @ panel.moved(door.open["door"])).apply(np.array([panel.origin, (-0.07, 0.65, 1.0)]))[:, :2]
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        off = world.robot_start.xy - ends[0]
        nearest = ends[0] + np.clip(off @ along, 0.0, np.linalg.norm(ends[1] - ends[0])) * along
        starts.append(np.linalg.norm(world.robot_start.xy - nearest))
    assert min(starts) > 0.4


def test_a_door_is_not_opened_farther_than_it_goes() -> None:
    with pytest.raises(ConfigurationError, match=r"unmapped\.new_door\.open\.door: opens from 0 to"):
        load_scene("kitchen_half_open_door", {"unmapped.new_door.open": {"door": "170 deg"}})
