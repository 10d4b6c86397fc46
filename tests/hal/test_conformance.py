"""Every implementation of the Robotics API keeps the promises of hal.conformance."""

from __future__ import annotations

import pytest

from hal.conformance import CHECKS, LIFE_CHECKS, Check, ConformanceError, settle
from hal.pybullet import PyBulletRobot


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.name)
def test_a_connected_pybullet_robot_keeps_its_promise(check: Check, standing_robot: PyBulletRobot) -> None:
    assert check.applies_to(standing_robot)
    try:
        check.run(standing_robot)
    finally:
        settle(standing_robot)


@pytest.mark.parametrize("check", LIFE_CHECKS, ids=lambda check: check.name)
def test_a_pybullet_robot_keeps_its_promise_about_connections(check: Check, robot_model, empty_world) -> None:
    robot = PyBulletRobot(robot_model, empty_world, seed=1)
    assert check.applies_to(robot)
    check.run(robot)


def test_a_robot_that_does_not_stop_is_found_out(robot_model, empty_world) -> None:
    class Runaway(PyBulletRobot):
        def stop(self) -> None:
            self._stopped = True

    stop_check = next(check for check in CHECKS if check.name == "stop brings everything to rest")
    with Runaway(robot_model, empty_world) as robot, pytest.raises(ConformanceError, match="at rest"):
        stop_check.run(robot)
