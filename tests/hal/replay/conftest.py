"""A short run, recorded."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.replay.recorder import RecordedRobot
from hal.replay.tape import TAPE_NAME
from tests.default_engine import DefaultRobot
from tests.hal.replay.story import Story, act


@pytest.fixture(scope="session")
def recorded(
    robot_model: RobotModel, empty_world: World, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Story]:
    """The folder of a run, and what was seen in it."""
    folder = tmp_path_factory.mktemp("run")
    with DefaultRobot(robot_model, empty_world, seed=3) as robot:
        seen = RecordedRobot(robot, folder / TAPE_NAME)
        story = act(seen)
        seen.close()
    return folder, story
