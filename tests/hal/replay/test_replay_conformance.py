"""A recording keeps the promises of hal.conformance that ask for no commands."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from hal.parts.channels import interface_of
from hal.replay.recorder import RecordedRobot
from hal.replay.robot import ReplayRobot
from hal.replay.tape import TAPE_NAME
from tests.default_engine import DefaultRobot

pytestmark = pytest.mark.slow
LENGTH = 40.0
"""Seconds: as long as the checks take together, with the rests between them."""


@pytest.fixture(scope="module")
def make_robot(robot_model: RobotModel, empty_world: World, tmp_path_factory: pytest.TempPathFactory) -> MakeRobot:
    """Of a robot that stands still and reads everything that it has."""
    tape = tmp_path_factory.mktemp("standing") / TAPE_NAME
    with DefaultRobot(robot_model, empty_world, seed=2) as robot:
        recorded = RecordedRobot(robot, tape)
        while robot.clock.now() < LENGTH:
            for part in recorded.parts.values():
                for reading in interface_of(type(part)).readings:
                    getattr(part, reading)()
            robot.clock.sleep(2.0)
        recorded.close()
    return lambda: ReplayRobot(robot_model, recording=tape)


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    pass
