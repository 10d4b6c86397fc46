"""Furniture that stands open, or that something inside was measured of, is hollow without being asked for."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.manipulation.collision.scene_from_world_model import planning_scene_from_world_model
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.scene.draw import draw_world
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.map_of_world import semantic_map
from bestman_bt.world_model.world_model import BasePose, Obstacle, WorldModel

DOOR = "fridge/upper_door"


@pytest.fixture
def believed() -> WorldModel:
    world = draw_world(load_scene("fridge_room"), 3)
    return WorldModel(semantic_map(world), base=BasePose(Pose2D(0.3, 0.0, 0.0), 0.01, 0.01, 0.0))


def bodies(world_model, robot) -> dict[str, tuple[PlacedShape, ...]]:
    scene = planning_scene_from_world_model(world_model, robot, robot.postures["home"])
    return {obstacle.name: obstacle.shapes for obstacle in scene.obstacles}


def shelf(world_model, name: str) -> Obstacle:
    furniture, surface = world_model.surface(f"fridge/{name}")
    pose = furniture.pose.to_pose() @ surface.pose @ Pose([0.0, 0.0, -0.004])
    return Obstacle(f"fridge/{name}/surface", (PlacedShape(Box((0.4, 0.5, 0.008)), pose),), 0.0)


def test_a_closed_fridge_is_solid_an_open_one_is_its_boards(believed, diff_panda) -> None:
    assert len(bodies(believed, diff_panda)["fridge"]) == 1
    believed.believe_articulation(DOOR, math.radians(90.0))
    opened = bodies(believed, diff_panda)
    assert len(opened["fridge"]) == len(believed.map.furniture["fridge"].shapes)
    assert {DOOR, "fridge/lower_door"} <= set(opened)


def test_a_measured_shelf_takes_the_place_of_the_one_on_the_map_even_when_the_door_is_shut(
    believed, diff_panda
) -> None:
    mapped = len(believed.map.furniture["fridge"].shapes)
    measured = shelf(believed, "shelf_4")
    believed.obstacles[measured.name] = measured
    found = bodies(believed, diff_panda)
    assert len(found["fridge"]) == mapped - 1
    assert measured.name in found


def test_a_measured_top_leaves_the_fridge_out_as_measured_furniture_always_was(believed, diff_panda) -> None:
    measured = Obstacle("fridge/top/surface", shelf(believed, "shelf_4").shapes, 0.0)
    believed.obstacles[measured.name] = measured
    assert "fridge" not in bodies(believed, diff_panda)


def test_boards_of_a_piece_that_was_measured_are_hardly_grown(believed, diff_panda) -> None:
    believed.believe_articulation(DOOR, math.radians(90.0))
    careful = bodies(believed, diff_panda)["fridge"]
    piece = believed.map.furniture["fridge"]
    believed.map = believed.map.with_furniture(replace(piece, position_error=0.004, heading_error=0.0))
    exact = bodies(believed, diff_panda)["fridge"]
    for board, grown, thin in zip(piece.shapes, careful, exact, strict=True):
        assert np.max(np.array(thin.shape.size) - board.shape.size) == pytest.approx(0.008, abs=1e-6)
        assert np.max(np.array(grown.shape.size) - board.shape.size) > 0.06


def test_a_door_that_stands_open_by_a_crack_makes_the_fridge_hollow(believed, diff_panda) -> None:
    believed.believe_articulation(DOOR, 0.05)
    assert len(bodies(believed, diff_panda)["fridge"]) > 1
