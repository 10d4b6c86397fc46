"""What can go wrong with a UR alone; all else is in tests/hal/hardware/test_faults.py."""

from __future__ import annotations

import pytest

from hal.api import MotionErrorCode
from hal.hardware.robot import HardwareRobot
from hal.parts.part_connection import ConnectionFailedError
from hal.twins.process import TwinProcess
from tests.hal.twinned import stopped_within, strike, works_again
from tests.rigs.twinned_robots import ARM, UR_ARM

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]


def test_an_sdk_process_that_was_killed_for_its_silence_is_begun_anew(
    robot: HardwareRobot, twin: TwinProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    motion = UR_ARM.begin(robot)
    since = strike(robot, twin, ARM, "program_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.FAULT
    twin.fault(ARM, "drop")
    monkeypatch.setattr("hal.ur.connection.READY_TIME", 0.5)
    with pytest.raises(ConnectionFailedError, match="does not answer within"):
        robot.clear_stop()
    monkeypatch.undo()
    twin.fault(ARM, "restore")
    works_again(robot, UR_ARM.begin)


def test_an_emergency_stop_can_only_be_released_at_the_robot(robot: HardwareRobot, twin: TwinProcess) -> None:
    motion = UR_ARM.begin(robot)
    since = strike(robot, twin, ARM, "emergency_stop")
    assert stopped_within(robot, motion, since, 0.1) is MotionErrorCode.STOPPED
    with pytest.raises(ConnectionFailedError, match="released at the robot"):
        robot.clear_stop()
    assert robot.stopped
    twin.fault(ARM, "emergency_release")  # which leaves the arm without power
    with pytest.raises(ConnectionFailedError, match="POWER_OFF: inspect the robot"):
        robot.clear_stop()
    twin.fault(ARM, "released")
    works_again(robot, UR_ARM.begin)
