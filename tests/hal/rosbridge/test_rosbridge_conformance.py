"""A ROS robot through roslibpy keeps the promises of hal.conformance."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model import RobotModel
from hal.conformance import CHECKS, LIFE_CHECKS, Check, settle
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time
NO_ARM = {
    "trajectories are checked",
    "servo refuses jumps",
    "gripper commands beyond limits are refused",
    "trajectories are followed",
    "set-points are streamed",
    "a gripper opens and closes",
}
"""What a base with a head cannot promise; anything else that does not apply is a fault of the test."""


@pytest.mark.parametrize("check", [c for c in CHECKS if c.name not in NO_ARM], ids=lambda check: check.name)
def test_a_connected_ros_robot_keeps_its_promise(check: Check, isolated_robot: IsolatedRobot) -> None:
    assert check.why_not(isolated_robot) is None
    try:
        check.run(isolated_robot)
    finally:
        settle(isolated_robot)


def test_what_does_not_apply_is_known(isolated_robot: IsolatedRobot) -> None:
    assert {check.name for check in CHECKS if check.why_not(isolated_robot) is not None} == NO_ARM


@pytest.mark.parametrize("check", LIFE_CHECKS, ids=lambda check: check.name)
def test_a_ros_robot_keeps_its_promise_about_connections(check: Check, ros_model: RobotModel) -> None:
    robot = IsolatedRobot(ros_model)
    assert check.why_not(robot) is None
    check.run(robot)
