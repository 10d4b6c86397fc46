"""A robot that breaks one promise is found out by the check of that promise, and by no other; a whole one by none."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.messages import Twist2D
from bestman_bt.robot_model.compose import compose_robot
from bestman_bt.robot_model.model import RobotModel
from bestman_bt.robot_model.sensor_parts import CameraPart
from hal.api import Arm
from hal.conformance import CHECKS, LIFE_CHECKS, motion_checks
from hal.conformance.subject import Check
from tests.hal.conformance import broken_commands, broken_connections, broken_readings, broken_stops
from tests.hal.conformance.changed_robot import Break, Make, changed, failing, of, wrapped
from tests.robot_models import seen_through

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "driver_in_memory"
ADDED = {
    "imu": ("imu", "base_link"),
    "pad": ("tactile_pad", "panda_leftfinger"),
    "bumper": ("bumper", "base_link"),
    "battery": ("battery", "base_link"),
}
BROKEN = [*broken_readings.BROKEN, *broken_commands.BROKEN, *broken_stops.BROKEN, *broken_connections.BROKEN]


@pytest.fixture(scope="module")
def small_model() -> RobotModel:
    """With a sensor of each kind, and cameras of few pixels: thousands of pictures are taken here."""
    parts = Document({"parts": {name: {"part": part, "mount": link} for name, (part, link) in ADDED.items()}})
    model = compose_robot("small", read_document(find_data("robot", "diff_panda")).merged(parts))
    cameras = {
        name: seen_through(camera, replace(camera.intrinsics, width=8, height=6))
        for name, camera in model.of(CameraPart).items()
    }
    return replace(model, parts={**model.parts, **cameras})


@pytest.fixture(scope="module")
def make(small_model: RobotModel) -> Make:
    sys.path.insert(0, str(EXAMPLE))
    spec = importlib.util.spec_from_file_location("memory_robot", EXAMPLE / "memory_robot.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.path.remove(str(EXAMPLE))
    return lambda: module.MemoryRobot(small_model)


def checks(names: Collection[str]) -> tuple[Check, ...]:
    return tuple(check for check in (*CHECKS, *LIFE_CHECKS) if check.name in names)


def test_a_robot_that_keeps_its_promises_is_not_accused(make: Make) -> None:
    assert failing(make, lambda robot: None) == []


@pytest.mark.parametrize(("promise", "spoil"), BROKEN, ids=[name for name, _ in BROKEN])
def test_a_broken_promise_is_found_out_by_its_check(make: Make, promise: str, spoil: Break) -> None:
    assert failing(make, spoil, checks([promise])) == [promise]


@pytest.mark.slow
@pytest.mark.parametrize(("promise", "spoil"), BROKEN, ids=[name for name, _ in BROKEN])
def test_a_broken_promise_is_found_out_by_no_other_check(
    make: Make, promise: str, spoil: Break, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(motion_checks, "COMMANDS_EACH", 30)  # a third of the time of all checks otherwise
    assert failing(make, spoil) == [promise]


def test_every_check_is_here() -> None:
    assert {promise for promise, _ in BROKEN} == {check.name for check in (*CHECKS, *LIFE_CHECKS)} - {
        "a gripper reads metres"  # what is no metre makes the gripper's own motions fail, too: see below
    }


def test_a_gripper_in_other_units_is_found_out(make: Make) -> None:
    in_centimetres = of("gripper", "width", lambda do: 100 * do())
    names = ["a gripper reads metres", "a gripper opens and closes"]
    assert set(failing(make, in_centimetres, checks(names))) == set(names)


def test_a_robot_that_does_not_stop_is_found_out(make: Make) -> None:
    def runaway(robot: Any) -> None:
        wrapped(robot, "stop", lambda do: robot._latch.set())

    assert failing(make, runaway) == [
        "stop brings everything to rest",
        "stop works from another thread",
    ]


def test_a_base_that_drives_on_and_reports_that_it_stands_is_found_out(make: Make) -> None:
    """By its odometry, which has to agree."""

    def rolling(robot: Any) -> None:
        wheels = robot.parts["base"]._channel
        wrapped(wheels, "send", lambda do, velocity: None if robot.stopped else do(velocity))
        wrapped(wheels, "read", lambda do: replace(do(), velocity=Twist2D(0.0, 0.0, 0.0)) if robot.stopped else do())

    names = ["stop brings everything to rest", "stop works from another thread"]
    assert failing(make, rolling, checks(names)) == names


def test_what_is_declared_missing_is_not_asked_for(make: Make) -> None:
    robot = make()
    del robot.parts["lidar"]
    changed(robot, unsupported=property(lambda self: {"lidar": "it is being repaired"}))
    (lidars,) = (check for check in CHECKS if check.name == "lidars give ranges within theirs")
    assert lidars.why_not(robot) == "it is being repaired"
    (parts,) = (check for check in LIFE_CHECKS if check.name.startswith("every part of the model"))
    parts.run(robot)


def test_a_robot_with_sensors_only_needs_no_motions(make: Make) -> None:
    robot = make()
    changed(robot, unsupported=property(lambda self: {"commands": "this is a recording"}))
    asked = {check.name for check in CHECKS if check.why_not(robot) is None}
    assert "readings are stamped" in asked
    assert "joints arrive within their limits" not in asked
    assert isinstance(robot.part("arm", Arm), Arm)
