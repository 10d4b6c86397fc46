"""Simulated robots, and one that exists in memory only, keep the promises of hal.conformance."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from bestman_bt.robot_model import load_robot_model
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from hal.conformance.room import empty_room
from hal.pybullet import PyBulletRobot

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "driver_in_memory"


def in_memory() -> MakeRobot:
    sys.path.insert(0, str(EXAMPLE))
    try:
        driver = importlib.import_module("memory_robot").MemoryRobot
    finally:
        sys.path.remove(str(EXAMPLE))
    model = load_robot_model("omni_ur5")
    return lambda: driver(model)


def in_pybullet(robot: str) -> MakeRobot:
    model = load_robot_model(robot)
    return lambda: PyBulletRobot(model, empty_room(), seed=1)


ROBOTS = {
    "in memory": in_memory,
    "diff_panda in pybullet": lambda: in_pybullet("diff_panda"),
    "omni_ur5 in pybullet": lambda: in_pybullet("omni_ur5"),
}


@pytest.fixture(scope="module", params=ROBOTS)
def make_robot(request: pytest.FixtureRequest) -> MakeRobot:
    return ROBOTS[request.param]()


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    pass
