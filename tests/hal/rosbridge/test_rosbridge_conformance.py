"""A ROS robot through roslibpy keeps the promises of hal.conformance."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model import RobotModel
from hal.api import Arm, Gripper
from hal.conformance import CHECKS, LIFE_CHECKS, Check, settle
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time
ABSENT = {Arm, Gripper}
"""What a base with a head and sensors does not have; anything else that does not apply is a fault of the test."""


def of_its_parts(checks: tuple[Check, ...]) -> list[Check]:
    return [check for check in checks if not ABSENT & set(check.needs)]


@pytest.mark.parametrize("check", of_its_parts(CHECKS), ids=lambda check: check.name)
def test_a_connected_ros_robot_keeps_its_promise(check: Check, isolated_robot: IsolatedRobot) -> None:
    assert check.why_not(isolated_robot) is None
    try:
        check.run(isolated_robot)
    finally:
        settle(isolated_robot)


@pytest.mark.parametrize("check", of_its_parts(LIFE_CHECKS), ids=lambda check: check.name)
def test_a_ros_robot_keeps_its_promise_about_connections(check: Check, ros_model: RobotModel) -> None:
    robot = IsolatedRobot(ros_model)
    assert check.why_not(robot) is None
    check.run(robot)


def test_nothing_but_parts_that_it_has_not_is_missing(ros_model: RobotModel) -> None:
    robot = IsolatedRobot(ros_model)
    reasons = {check.why_not(robot) for check in CHECKS + LIFE_CHECKS}
    assert reasons == {None, "the robot has no arm", "the robot has no gripper"}
