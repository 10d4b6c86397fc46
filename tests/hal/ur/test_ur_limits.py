"""What the robot's YAML allows a UR at most also binds the motions that its controller plans by itself."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bestman_bt.robot_model.bringup_file import with_bringup_limits
from bestman_bt.robot_model.compose import load_robot_model
from hal.api import CommandRefusedError, MotionErrorCode
from hal.hardware.robot import HardwareRobot
from hal.parts.gate import ToolLimits
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from hal.ur.arm import URArm
from tests.hal.twinned import arrived, ended, twin_settings

pytestmark = [pytest.mark.real_time, pytest.mark.alone]

ROBOT = Path(__file__).parent / "ur5e_on_a_base.yaml"
STEP = np.array([0.3, 0, 0, 0, 0, 0])


@contextmanager
def connected(twin: TwinProcess, **settings: Any) -> Iterator[tuple[HardwareRobot, URArm]]:
    with HardwareRobot(load_robot_model(ROBOT, twin_settings(twin, **settings))) as robot:
        yield robot, robot.part("arm", URArm)


@pytest.mark.slow
def test_motions_of_the_controller_are_held_to_the_limits_above_it(twin: TwinProcess) -> None:
    with connected(twin) as (robot, arm):
        arrived(robot, arm.move_to(robot.model.posture("home", arm.joint_names)))
        place = ToolLimits(robot.model, "arm", robot.model.safety).tool(arm.positions())
    box = {side: [f"{at} m" for at in end] for side, end in (("lower", place - 0.1), ("upper", place + 0.1))}
    with connected(twin, safety__workspace=box, safety__tool_speed="0.1 m/s") as (robot, arm):
        with pytest.raises(CommandRefusedError, match="workspace"):
            arm.move_path([arm.positions() + 3 * STEP])
        with pytest.raises(CommandRefusedError, match="faster than its limit"):
            arm.speed_tool([0.2, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0)
        with pytest.raises(CommandRefusedError, match="faster than its limit"):
            arm.speed_joints(3 * STEP, 1.0)
        motion = ended(robot, arm.speed_tool([0.0, 0.0, 0.08, 0.0, 0.0, 0.0], 10.0))
        assert motion.failure is not None
        assert motion.failure.code is MotionErrorCode.FAULT
        assert "workspace" in motion.failure.text
        robot.clock.sleep(0.5)
        assert np.max(np.abs(arm.velocities())) < 0.01
        assert ToolLimits(robot.model, "arm", robot.model.safety).tool(arm.positions())[2] < place[2] + 0.12


@pytest.mark.slow
def test_nothing_goes_on_after_the_robot_is_disconnected(twin: TwinProcess) -> None:
    before = set(threading.enumerate())
    with connected(twin) as (robot, _):
        assert set(threading.enumerate()) - before
    assert set(threading.enumerate()) - before == set()
    assert robot.diagnostics()["connected"] == "no"


@pytest.mark.slow
def test_another_mounting_at_the_controller_is_reported_and_refused_once_the_bring_up_has_measured_it(
    twin: TwinProcess,
) -> None:
    model = load_robot_model(ROBOT, twin_settings(twin))
    brought_up, _ = with_bringup_limits(model)
    with HardwareRobot(brought_up) as robot:
        assert "arm_controller remarks" not in robot.diagnostics()
    twin.fault("arm_controller", "other_mounting")
    try:
        with HardwareRobot(model) as robot:
            assert "mounted as in the file, it needs" in robot.diagnostics()["arm_controller remarks"]
        with pytest.raises(ConnectionFailedError, match="mounted as in the file, it needs"):
            HardwareRobot(brought_up).connect()
        not_measured = replace(brought_up, measured={**brought_up.measured, "mounting": frozenset()})
        with HardwareRobot(not_measured) as robot:
            assert "mounted as in the file, it needs" in robot.diagnostics()["arm_controller remarks"]
    finally:
        twin.fault("arm_controller", "as_built")
