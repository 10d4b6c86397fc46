"""A UR through ur-rtde, with a Robotiq gripper beside it, keeps the promises of hal.conformance."""

from __future__ import annotations

from functools import partial

import pytest

from bestman_bt.robot_model import RobotModel
from hal.conformance import CHECKS, LIFE_CHECKS
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time


@pytest.fixture(scope="module")
def make_robot(twin_model: RobotModel) -> MakeRobot:
    return partial(IsolatedRobot, twin_model)


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    pass


def test_nothing_but_parts_that_it_has_not_is_missing(make_robot: MakeRobot) -> None:
    reasons = {check.why_not(make_robot()) for check in CHECKS + LIFE_CHECKS}
    assert None in reasons
    assert all(reason.startswith(("the robot has no ", "it is behind no connection")) for reason in reasons - {None})
