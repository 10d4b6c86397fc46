"""The robot and the small worlds that the tests of the hardware layer share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from bestman_bt.messages import Box, Cylinder, ObjectModel, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model import RobotModel, load_robot_model
from bestman_bt.scene import FurnitureModel, PlacedFurniture, PlacedObject, Surface, Wall, World
from hal.pybullet import PyBulletRobot

TABLE_TOP = 0.75
SHAPES = {"box": Box((0.04, 0.06, 0.10)), "can": Cylinder(0.033, 0.10)}


@pytest.fixture(scope="session")
def robot_model() -> RobotModel:
    return load_robot_model("diff_panda")


@pytest.fixture(scope="session")
def empty_world() -> World:
    """Four walls, 3 m away from the robot."""
    corners = ((-3.0, -3.0), (3.0, -3.0), (3.0, 3.0), (-3.0, 3.0))
    walls = tuple(Wall(a, b, 1.2, 0.1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    return World("empty", 0, walls, (), (), Pose2D(0.0, 0.0, 0.0), {})


@pytest.fixture(scope="session")
def table_worlds(empty_world: World) -> dict[str, World]:
    """A table in front of the robot with one object on it, by the name of the object."""
    top = PlacedShape(Box((0.8, 1.2, 0.03)), Pose.from_xyz_rpy((0.0, 0.0, TABLE_TOP - 0.015)))
    surface = Surface("top", Pose.from_xyz_rpy((0.0, 0.0, TABLE_TOP)), (0.8, 1.2))
    model = FurnitureModel("table", (0.8, 1.2), (top,), ((0.6, 0.4, 0.25, 1.0),), (surface,))
    table = PlacedFurniture("table", model, Pose2D(0.85, 0.0, 0.0), Pose2D(0.86, 0.01, 0.01))
    worlds = {}
    for name, shape in SHAPES.items():
        solid = ObjectModel(name, (0.8, 0.2, 0.2), 0.2, 0.8, (PlacedShape(shape, Pose()),))
        placed = PlacedObject(name, solid, Pose.from_xyz_rpy((0.65, -0.1, TABLE_TOP + 0.051), (0.0, 0.0, 0.3)))
        worlds[name] = World("table", 0, empty_world.walls, (table,), (placed,), Pose2D(0.0, 0.0, 0.0), {})
    return worlds


@pytest.fixture(scope="session")
def standing_robot(robot_model: RobotModel, empty_world: World) -> Iterator[PyBulletRobot]:
    """A connected robot in the empty world, shared by tests that leave it standing still."""
    with PyBulletRobot(robot_model, empty_world, seed=1) as robot:
        yield robot
