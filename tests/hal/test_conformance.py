"""Simulated robots, and one that exists in memory only, keep the promises of hal.conformance."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.robot_model.compose import compose_robot, load_robot_model
from hal.api import Robot
from hal.conformance.base_checks import BASE_CHECKS
from hal.conformance.command_line import empty_room
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from hal.conformance.stop_checks import STOP_CHECKS
from hal.conformance.subject import Check, settle
from hal.mujoco.robot import MujocoRobot
from hal.pybullet.robot import PyBulletRobot
from hal.simulation.robot import SimulatedRobot
from tests.hal.simulation.kinematic_engine import KinematicRobot

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "driver_in_memory"


def in_memory() -> MakeRobot:
    sys.path.insert(0, str(EXAMPLE))
    try:
        driver = importlib.import_module("memory_robot").MemoryRobot
    finally:
        sys.path.remove(str(EXAMPLE))
    model = load_robot_model("omni_ur5")
    return lambda: driver(model)


def simulated(driver: type[SimulatedRobot], robot: str, **parts: tuple[str, str]) -> MakeRobot:
    """``parts``: more of them, name → part and the link that carries it."""
    more = Document({"parts": {name: {"part": part, "mount": link} for name, (part, link) in parts.items()}})
    model = compose_robot(robot, read_document(find_data("robot", robot)).merged(more))
    return lambda: driver(model, empty_room(), seed=1)


SENSORS = {
    "imu": ("imu", "base_link"),
    "pad": ("tactile_pad", "panda_leftfinger"),
    "bumper": ("bumper", "base_link"),
    "battery": ("battery", "base_link"),
}
ROBOTS = {
    "in memory": in_memory,
    "diff_panda without forces": lambda: simulated(KinematicRobot, "diff_panda", **SENSORS),
    "diff_panda in mujoco": lambda: simulated(MujocoRobot, "diff_panda", **SENSORS),
    "diff_panda in pybullet": lambda: simulated(PyBulletRobot, "diff_panda", **SENSORS),
}


@pytest.fixture(
    scope="module",
    params=["in memory", *(pytest.param(name, marks=pytest.mark.slow) for name in list(ROBOTS)[1:])],
)
def make_robot(request: pytest.FixtureRequest) -> MakeRobot:
    if "mujoco" in request.param:
        pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    return ROBOTS[request.param]()


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    pass


@pytest.fixture(scope="module")
def omnidirectional() -> Iterator[Robot]:
    with simulated(PyBulletRobot, "omni_ur5")() as robot:
        yield robot


QUICK = ("a base moves in its own frame", "velocities of a base lapse", "nothing moves when the stop is cleared")


@pytest.mark.parametrize(
    "check",
    [
        pytest.param(check, id=check.name, marks=() if check.name in QUICK else pytest.mark.slow)
        for check in (*BASE_CHECKS, *STOP_CHECKS)
    ],
)
def test_a_simulated_robot_whose_base_drives_sideways_keeps_its_promises(check: Check, omnidirectional: Robot) -> None:
    assert check.why_not(omnidirectional) is None
    try:
        check.run(omnidirectional)
    finally:
        settle(omnidirectional)
