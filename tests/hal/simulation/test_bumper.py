from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.messages import Box, PlacedShape, Pose, Pose2D
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.sensor_parts import MountedBumper
from bestman_bt.scene.scene import FurnitureModel, PlacedFurniture, World
from hal.api import Bumper, MobileBase, NoDataError
from hal.simulation.sensor_pipeline import SensorFault
from tests.default_engine import DefaultRobot


def box_at(pose: Pose2D) -> PlacedFurniture:
    part = PlacedShape(Box((0.1, 1.0, 0.6)), Pose(np.array([0.0, 0.0, 0.3])))
    return PlacedFurniture("box", FurnitureModel("box", (0.1, 1.0), (part,), ((0.5, 0.5, 0.5, 1.0),), ()), pose, pose)


@pytest.fixture(scope="module")
def model():
    more = Document({"parts": {"bumper": {"part": "bumper", "mount": "base_link"}}})
    return compose_robot("bumped", read_document(find_data("robot", "diff_panda")).merged(more))


@pytest.fixture
def robot(model):
    empty = World("floor", 0, (), (), (), Pose2D(), {})
    with DefaultRobot(model, replace(empty, furniture=(box_at(Pose2D(0.45, 0.0, 0.0)),)), seed=1) as connected:
        yield connected


def test_strips_go_around_the_footprint(model):
    zones = model.of(MountedBumper)["bumper"].zones
    assert len(zones) == 12
    assert all(end == start for (_, end), (start, _) in zip(zones, (*zones[1:], zones[0]), strict=True))
    angles = np.unwrap([math.atan2(*start[::-1]) for start, _ in zones])
    assert np.all(np.diff(angles) > 0.0)


def test_driving_against_a_box_presses_the_strips_in_front_and_nothing_else(robot):
    bumper, base = robot.part("bumper", Bumper), robot.part("base", MobileBase)
    assert bumper.read().pressed == ()
    for _ in range(30):
        base.set_velocity(0.15, 0.0, 0.0)
        robot.clock.sleep(0.1)
    pressed = bumper.read().pressed
    assert pressed
    assert all(bumper.zones[zone].middle[0] > 0.15 for zone in pressed)
    for _ in range(10):
        base.set_velocity(-0.15, 0.0, 0.0)
        robot.clock.sleep(0.1)
    assert bumper.read().pressed == ()


def test_a_bumper_can_be_switched_off(robot):
    bumper = robot.parts["bumper"]
    bumper.fault = SensorFault.SILENT
    with pytest.raises(NoDataError, match="bumper"):
        bumper.read()
