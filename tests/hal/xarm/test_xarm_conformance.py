"""An xArm through the vendor's SDK keeps the promises of hal.conformance, as far as it has the parts."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model import RobotModel
from hal.conformance import CHECKS, LIFE_CHECKS, Check, settle
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time

NO_BASE = {
    "base commands beyond limits are refused",
    "velocities of a base lapse",
    "a base drives and turns by odometry",
    "a part can be stopped by itself",
}
"""What an arm cannot promise; anything else that does not apply is a fault of the test."""


@pytest.mark.parametrize("check", [c for c in CHECKS if c.name not in NO_BASE], ids=lambda check: check.name)
def test_a_connected_xarm_keeps_its_promise(check: Check, isolated_robot: IsolatedRobot) -> None:
    assert check.applies_to(isolated_robot)
    try:
        check.run(isolated_robot)
    finally:
        settle(isolated_robot)


@pytest.mark.parametrize("check", LIFE_CHECKS, ids=lambda check: check.name)
def test_an_xarm_keeps_its_promise_about_connections(check: Check, xarm_model: RobotModel) -> None:
    robot = IsolatedRobot(xarm_model)
    assert check.applies_to(robot)
    check.run(robot)


def test_what_does_not_apply_is_known(isolated_robot: IsolatedRobot) -> None:
    assert {check.name for check in CHECKS if not check.applies_to(isolated_robot)} == NO_BASE
