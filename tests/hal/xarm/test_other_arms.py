"""An xArm 7, and a Lite 6 with its own gripper, through the vendor's SDK; a controller of another arm is refused.

The whole suite over them is a command: docs/hardware.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.robot_model.model import ArmModel
from hal.api import Arm, CommandRefusedError, Gripper, Motion, MotionStatus
from hal.conformance import CHECKS
from hal.conformance.subject import settle
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import disconnected, twin_settings

pytestmark = [pytest.mark.real_time, pytest.mark.slow]
# `make test` installs it; another installation may be without the vendor's SDK.
pytest.importorskip("xarm", reason="the extra xarm is not installed")

XARM7, LITE6 = (Path(__file__).parent / f"{name}_on_a_base.yaml" for name in ("xarm7", "lite6"))
FEW = ("joint commands beyond limits are refused", "servo refuses jumps", "trajectories are followed")


@pytest.fixture(scope="module", params=[XARM7, LITE6], ids=lambda file: file.stem)
def hosted(request: pytest.FixtureRequest) -> Iterator[tuple[TwinProcess, Path]]:
    with TwinProcess(request.param, "pick_place_table", seed=1) as twin:
        yield twin, request.param


@pytest.fixture(scope="module")
def robot(hosted: tuple[TwinProcess, Path]) -> Iterator[HardwareRobot]:
    twin, file = hosted
    with HardwareRobot(load_robot_model(file, twin_settings(twin))) as robot:
        yield robot


def finished(robot: HardwareRobot, motion: Motion) -> None:
    while not motion.done:
        robot.clock.sleep(0.05)
    assert motion.status is MotionStatus.SUCCEEDED, motion.failure


def test_all_joints_arrive_where_they_are_sent_and_in_that_order(
    robot: HardwareRobot, hosted: tuple[TwinProcess, Path]
) -> None:
    arm = robot.part("arm", Arm)
    target = arm.positions() + 0.02 * np.arange(1, len(arm.joint_names) + 1)
    finished(robot, arm.move_to(target, 0.5))
    assert arm.positions() == pytest.approx(target, abs=0.005)
    assert hosted[0].judge("joints", "arm")["positions"] == pytest.approx(target.tolist(), abs=0.01)


@pytest.mark.parametrize("check", [check for check in CHECKS if check.name in FEW], ids=lambda check: check.name)
def test_it_keeps_a_few_promises(check: Any, robot: HardwareRobot) -> None:
    try:
        check.run(robot)
    finally:
        settle(robot)


def test_its_gripper_closes_and_opens(robot: HardwareRobot, hosted: tuple[TwinProcess, Path]) -> None:
    gripper = robot.part("gripper", Gripper)
    for width in (gripper.model.part.min_width, gripper.model.max_width) * 2:
        finished(robot, gripper.move(width))
        assert gripper.width() == pytest.approx(width, abs=0.003)
        for _ in range(50):  # a Lite 6's goes by the clock, and the twin's world may be behind it
            if abs(hosted[0].judge("width", "gripper") - width) < 0.003:
                break
            robot.clock.sleep(0.1)
        assert hosted[0].judge("width", "gripper") == pytest.approx(width, abs=0.003)


@pytest.mark.parametrize("hosted", [LITE6], ids=lambda file: file.stem, indirect=True)
def test_a_lite6s_gripper_claims_nothing_that_it_cannot_know(robot: HardwareRobot) -> None:
    gripper = robot.part("gripper", Gripper)
    finished(robot, gripper.close())
    assert gripper.state().at_target
    assert not gripper.state().empty
    assert not gripper.state().object_held
    with pytest.raises(CommandRefusedError, match="nothing between"):
        gripper.move(0.01)
    assert "no encoder" in robot.unsupported["a gripper opens and closes"]


def test_a_controller_of_another_arm_is_refused_before_anything_moves(
    robot: HardwareRobot, hosted: tuple[TwinProcess, Path]
) -> None:
    twin, file = hosted
    arm = {"arm": "lite6" if file is XARM7 else "xarm"}
    other = load_robot_model(file, {**twin_settings(twin), "connections.arm_controller.options": arm})
    with disconnected(robot), pytest.raises(ConnectionFailedError, match="the option 'arm' says"):
        HardwareRobot(other).connect()
    model = robot.model.parts["arm"]
    assert isinstance(model, ArmModel)
    count = len(model.joint_names)
    limits = replace(model.part.limits, lower=(-6.28,) * count, upper=(6.28,) * count)
    parts = {**robot.model.parts, "arm": replace(model, part=replace(model.part, limits=limits))}
    wider = replace(robot.model, parts=parts)
    with disconnected(robot), pytest.raises(ConnectionFailedError, match=r"joint2 goes from .* 'set' its limits"):
        HardwareRobot(wider).connect()
