"""A ROS robot through roslibpy keeps the promises of hal.conformance, as far as it has the parts."""

from __future__ import annotations

from functools import partial

import pytest

from bestman_bt.robot_model.model import RobotModel
from hal.conformance.promises import MakeRobot, PromisesAboutConnecting, PromisesOfAConnectedRobot
from hal.hardware.robot import HardwareRobot
from tests.hal.twinned import why_checks_do_not_apply

pytestmark = [pytest.mark.real_time, pytest.mark.slow]


class TestConnected(PromisesOfAConnectedRobot):
    pass


class TestConnecting(PromisesAboutConnecting):
    """In this process: the one of a client's own is connected to an xArm, see there."""

    @pytest.fixture(scope="class")
    @classmethod
    def make_robot(cls, twin_model: RobotModel) -> MakeRobot:
        return partial(HardwareRobot, twin_model)


def test_nothing_but_parts_that_it_has_not_is_missing(make_robot: MakeRobot) -> None:
    assert all(reason.startswith("the robot has no ") for reason in why_checks_do_not_apply(make_robot))
