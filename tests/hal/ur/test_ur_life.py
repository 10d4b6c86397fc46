"""A UR through ur-rtde keeps the promises of hal.conformance about connections."""

from __future__ import annotations

import pytest

from bestman_bt.robot_model import RobotModel
from hal.conformance import LIFE_CHECKS, Check
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time


@pytest.mark.parametrize("check", LIFE_CHECKS, ids=lambda check: check.name)
def test_a_ur_keeps_its_promise_about_connections(check: Check, ur_model: RobotModel) -> None:
    robot = IsolatedRobot(ur_model)
    assert check.applies_to(robot)
    check.run(robot)
