"""Furniture that an arm works in: reachable inside, solid where boards and doors may be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.scene_from_world_model import hollow_furniture, planning_scene_from_world_model
from bestman_bt.manipulation.errors import ManipulationError
from bestman_bt.messages import Box, Handle, PlacedShape, Pose, Pose2D, distance_to_shape
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.scene.scene import PlacedFurniture, World
from bestman_bt.world_model.semantic_map import MapArticulation, MapFurniture, MapSurface, SemanticMap
from bestman_bt.world_model.world_model import BasePose, HandleBelief, Obstacle, WorldModel

ROOM = draw_world(load_scene("chest_room"), 0)


def believed(scene: str, seed: int = 3) -> tuple[World, WorldModel]:
    world = draw_world(load_scene(scene), seed)
    return world, WorldModel(semantic_map(world), base=BasePose(Pose2D(0.3, 0.0, 0.0), 0.01, 0.01, 0.0))


def shapes(world_model, robot, *names, **options):
    scene = planning_scene_from_world_model(world_model, robot, robot.postures["home"], **options)
    found = {obstacle.name: obstacle for obstacle in scene.obstacles}
    return [shape for name in names for shape in found[name].shapes] if names else found


def distance(obstacles: list[PlacedShape], world_model: WorldModel, points: np.ndarray) -> np.ndarray:
    """Smallest distance of points (N, 3) of the map frame to shapes in the base frame."""
    in_base = world_model.base.pose.to_pose().inverse().apply(points)
    return np.min([distance_to_shape(in_base, shape) for shape in obstacles], axis=0)


def inside_points(piece: PlacedFurniture, surface: str, moved: float = 0.0) -> np.ndarray:
    where = next(s for s in piece.model.all_surfaces if s.name == surface)
    local = np.array([[x, y, 0.08] for x in (-0.10, 0.0) for y in (-0.1, 0.0, 0.1)])
    return (piece.nominal.to_pose() @ Pose(np.array([-moved, 0.0, 0.0])) @ where.pose).apply(local)


def test_by_default_furniture_is_a_solid_box_whatever_the_map_knows(diff_panda) -> None:
    _, world_model = believed("fridge_room")
    (box,) = shapes(world_model, diff_panda, "fridge")
    assert box.shape.size[2] == pytest.approx(1.72)
    assert not [name for name in shapes(world_model, diff_panda) if "/" in name]


def test_an_open_fridge_can_be_reached_into_and_a_closed_one_has_its_door(diff_panda) -> None:
    world, world_model = believed("fridge_room")
    points = inside_points(world.furniture[0], "shelf_4")
    hollow = {"hollow": ["fridge"]}
    assert np.all(distance(shapes(world_model, diff_panda, "fridge"), world_model, points) <= 0.0)
    assert np.all(distance(shapes(world_model, diff_panda, "fridge", **hollow), world_model, points) > 0.03)
    middle = world.furniture[0].nominal.to_pose().apply(np.array([[-0.30, 0.0, 1.3]]))
    door = shapes(world_model, diff_panda, "fridge/upper_door", **hollow)
    assert distance(door, world_model, middle)[0] <= 0.0
    world_model.articulations["fridge/upper_door"] = math.radians(90)
    door = shapes(world_model, diff_panda, "fridge/upper_door", **hollow)
    assert distance(door, world_model, middle)[0] > 0.15
    swung = world.furniture[0].nominal.to_pose().apply(np.array([[-0.55, -0.30, 1.3]]))  # hinged at its right, -y
    assert distance(door, world_model, swung)[0] <= 0.0


def test_a_drawer_is_open_at_the_top_once_it_is_believed_to_be_open(diff_panda) -> None:
    world, world_model = believed("chest_room")
    names = ("drawer_chest", "drawer_chest/drawer_1", "drawer_chest/drawer_2", "drawer_chest/drawer_3")
    chest = world.furniture[0]
    over = inside_points(chest, "drawer_3", moved=0.30) + np.array([0.0, 0.0, 0.35])  # the hand comes from above
    over = over[over[:, 0] < chest.nominal.x - chest.model.footprint[0] / 2 - 0.05]
    assert len(over)
    in_drawer = over - np.array([0.0, 0.0, 0.35])
    closed = shapes(world_model, diff_panda, *names, hollow=["drawer_chest"])
    world_model.articulations["drawer_chest/drawer_3"] = 0.30
    opened = shapes(world_model, diff_panda, *names, hollow=["drawer_chest"])
    assert np.all(distance(opened, world_model, over) > 0.03)
    assert np.all(distance(opened, world_model, in_drawer) > 0.0)
    bottom = in_drawer - np.array([0.0, 0.0, 0.084])
    assert np.all(distance(opened, world_model, bottom) <= 0.0)
    assert np.all(distance(closed, world_model, bottom) > 0.0)


@pytest.mark.parametrize("name", ["fridge", "drawer_chest", "microwave", "cupboard", "dishwasher"])
def test_boards_and_doors_cover_wherever_the_piece_may_stand(diff_panda, name: str) -> None:
    """But for handles, which are seen and not told."""
    model = read_furniture(name)
    rng = np.random.default_rng(0)
    told = Pose2D(1.0, 0.1, 0.4)
    for _ in range(12):
        dx, dy, turn = rng.uniform(-1, 1, 3) * (0.03, 0.03, math.radians(2.0))
        actual = Pose2D(told.x + dx, told.y + dy, told.theta + turn)
        piece = PlacedFurniture(name, model, told, actual)
        world_model = WorldModel(
            semantic_map(World("", 0, ROOM.walls, (piece,), (), Pose2D(), {})),
            base=BasePose(Pose2D(), 0.01, 0.01, 0.0),
        )
        world_model.articulations = {
            f"{name}/{articulation.name}": 0.6 * articulation.upper for articulation in model.articulations
        }
        everything = [
            shape
            for key, body in shapes(world_model, diff_panda, hollow=[name]).items()
            if key.partition("/")[0] == name
            for shape in body.shapes
        ]
        articulations = world_model.map.furniture[name].articulations
        truly = [(shape, Pose()) for shape in world_model.map.furniture[name].shapes]
        truly += [
            (s, articulation.moved(0.6 * articulation.upper))
            for articulation in articulations
            for s in articulation.shapes
        ]
        corners = np.vstack([(piece.pose @ moved @ shape.pose).apply(_corners(shape)) for shape, moved in truly])
        assert np.all(distance(everything, world_model, corners) <= 1e-6)


def _corners(placed: PlacedShape) -> np.ndarray:
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return signs * np.array(placed.shape.size) / 2


def test_the_map_tells_of_boards_but_not_of_handles() -> None:
    for name in ("fridge", "drawer_chest", "microwave", "cupboard", "dishwasher", "room_door"):
        model = read_furniture(name)
        at = Pose2D()
        piece = PlacedFurniture(name, model, at, at)
        told = semantic_map(World("", 0, ROOM.walls, (piece,), (), Pose2D(), {})).furniture[name]
        assert len(told.articulations) == len(model.articulations) > 0
        for articulation, true in zip(told.articulations, model.articulations, strict=True):
            middle, standoff = true.handle.pose.position, true.handle.standoff
            nearest = min(distance_to_shape(middle[None], shape)[0] for shape in articulation.shapes)
            if true.handle.kind == "edge":
                groove = middle + np.array([0.0, 0.0, 0.02])  # a groove is filled up
                assert min(distance_to_shape(groove[None], shape)[0] for shape in articulation.shapes) <= 0.0
            else:
                assert nearest == pytest.approx(standoff, abs=0.002)


def test_a_measured_door_replaces_the_mapped_one_and_unknown_furniture_is_refused(diff_panda) -> None:
    _, world_model = believed("fridge_room")
    seen = PlacedShape(world_model.map.furniture["fridge"].shapes[0].shape, Pose(np.array([0.9, 0.0, 1.0])))
    world_model.obstacles["fridge/upper_door"] = Obstacle("fridge/upper_door", (seen,), 1.0)
    found = shapes(world_model, diff_panda, hollow=["fridge"])
    assert len(found["fridge/upper_door"].shapes) == 1
    assert found["fridge/upper_door"].shapes[0].shape is seen.shape
    assert "fridge" in found
    scene = planning_scene_from_world_model(world_model, diff_panda, diff_panda.postures["home"], hollow=["fridge"])
    names = [obstacle.name for obstacle in scene.obstacles]
    assert len(names) == len(set(names))
    with pytest.raises(ManipulationError, match="the map has no furniture 'frigde' to work in; there is fridge"):
        shapes(world_model, diff_panda, hollow=["frigde"])


FRONT = PlacedShape(Box((0.02, 0.6, 0.2)), Pose(np.array([-0.25, 0.0, 0.5])))
SHELF, SIDE = (
    PlacedShape(Box((0.5, 0.6, 0.02)), Pose(np.array([0.0, 0.0, 0.39]))),
    PlacedShape(Box((0.5, 0.02, 0.8)), Pose(np.array([0.0, 0.3, 0.4]))),
)
CABINET = MapFurniture(
    "cabinet",
    Pose2D(2.0, 1.0, 2.2),
    (0.5, 0.6),
    0.8,
    (
        MapSurface("shelf", Pose(np.array([0.0, 0.0, 0.40])), (0.5, 0.6)),
        MapSurface("top", Pose([0, 0, 0.8]), (0.5, 0.6)),
    ),
    True,
    shapes=(SHELF, SIDE),
    articulations=(MapArticulation("drawer", "prismatic", (0.0, 0.0, 0.5), (-1.0, 0.0, 0.0), 0.4, (FRONT,)),),
    position_error=0.01,
    heading_error=math.radians(1.0),
)
ORIGIN = Pose2D()
NO_ERROR = {"offset": 0.0, "turn": 0.0}


def cabinet() -> WorldModel:
    return WorldModel(SemanticMap(np.zeros((0, 4)), {"cabinet": CABINET}), base=BasePose(Pose2D(), 0.01, 0.01, 0.0))


def bodies_of(world_model: WorldModel, base: Pose2D = ORIGIN, reach: float = 5.0, **errors: float):
    options = {"offset": 0.03, "turn": math.radians(2.0), **errors}
    found = hollow_furniture(world_model, base.to_pose().inverse(), ["cabinet"], reach=reach, **options)
    return {obstacle.name: obstacle.shapes for obstacle in found}


def test_a_piece_counts_as_far_as_its_footprint_reaches() -> None:
    """Its middle is 2.24 m away, its outline at most 0.39 m nearer."""
    assert bodies_of(cabinet(), reach=1.90)
    assert bodies_of(cabinet(), reach=1.80) == {}


def test_boards_are_grown_by_what_the_piece_or_the_scene_errs_whichever_is_less() -> None:
    """A board along y: its ends move by the turn most, its faces hardly."""
    cosine, sine, turn = abs(math.cos(2.2)), abs(math.sin(2.2)), math.radians(1.0)
    shelf = bodies_of(cabinet())["cabinet"][0].shape.size
    away = 1.0 - math.cos(turn)
    across = 0.01 * (cosine + sine) + math.sin(turn) * np.array([0.3, 0.25]) + away * math.hypot(0.25, 0.3)
    assert shelf == pytest.approx((0.5 + 2 * across[0], 0.6 + 2 * across[1], 0.02), abs=1e-9)
    exact = bodies_of(cabinet(), **NO_ERROR)["cabinet"][0]
    assert exact.shape.size == pytest.approx(SHELF.shape.size)
    assert np.allclose(exact.pose.matrix, (CABINET.pose.to_pose() @ SHELF.pose).matrix)


def handle_on(world_model: WorldModel) -> PlacedShape:
    """A bar before the front of the drawer, seen in the map frame where the drawer is believed; as a box there."""
    front = CABINET.pose.to_pose() @ world_model.opening_of(CABINET, CABINET.articulations[0]) @ FRONT.pose
    pose = (
        front
        @ Pose.from_xyz_rpy((-0.05, 0.0, 0.0), (0.0, -math.pi / 2, 0.0))
        @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, math.pi / 2))
    )
    bar = Handle("bar", pose, 0.006, 0.2, 0.04, pose.rotation[:, 2], 0.9, 0.002)
    world_model.handles["bar"] = HandleBelief("bar", bar, 0.0, "cabinet")
    return PlacedShape(Box((0.2, 0.012, 0.046)), pose)


def test_a_drawer_that_stands_open_has_its_handle_and_a_closed_one_has_not() -> None:
    base, closed, opened = Pose2D(0.4, -0.3, 0.7), cabinet(), cabinet()
    handle_on(closed)
    assert len(bodies_of(closed, base)["cabinet/drawer"]) == 1
    opened.believe_articulation("cabinet/drawer", 0.2)
    bar = handle_on(opened)
    front, handle = bodies_of(opened, base, **NO_ERROR)["cabinet/drawer"]
    moved = CABINET.pose.to_pose() @ Pose(np.array([-0.2, 0.0, 0.0])) @ FRONT.pose
    assert np.allclose((base.to_pose() @ front.pose).matrix, moved.matrix)
    assert distance_to_shape((base.to_pose().inverse() @ bar.pose).position[None], handle)[0] == 0.0


@pytest.mark.parametrize(("height", "boards"), [(0.40, 1), (0.396, 1), (0.41, 2), (0.36, 2)])
def test_a_measured_surface_takes_the_place_of_the_level_board_below_it_alone(height: float, boards: int) -> None:
    world_model = cabinet()
    surfaces = (MapSurface("shelf", Pose(np.array([0.0, 0.0, height])), (0.5, 0.6)), CABINET.surfaces[1])
    world_model.map = world_model.map.with_furniture(replace(CABINET, surfaces=surfaces))
    world_model.obstacles["cabinet/shelf/surface"] = Obstacle("cabinet/shelf/surface", (SHELF,), 1.0)
    assert len(bodies_of(world_model)["cabinet"]) == boards


def test_a_board_beside_the_measured_surface_stays() -> None:
    world_model = cabinet()
    beside = PlacedShape(SHELF.shape, Pose(np.array([0.8, 0.0, 0.39])))
    world_model.map = world_model.map.with_furniture(replace(CABINET, shapes=(beside, SIDE)))
    world_model.obstacles["cabinet/shelf/surface"] = Obstacle("cabinet/shelf/surface", (SHELF,), 1.0)
    assert len(bodies_of(world_model)["cabinet"]) == 2


def test_a_measured_drawer_front_takes_the_place_of_the_mapped_one() -> None:
    world_model = cabinet()
    world_model.obstacles["cabinet/drawer"] = Obstacle("cabinet/drawer", (FRONT,), 1.0)
    assert set(bodies_of(world_model)) == {"cabinet"}
