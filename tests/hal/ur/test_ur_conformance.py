"""A UR through ur-rtde, with a Robotiq gripper beside it, keeps the promises of hal.conformance."""

from __future__ import annotations

import pytest

from hal.conformance import CHECKS, Check, settle
from hal.hardware import IsolatedRobot

pytestmark = pytest.mark.real_time

NO_BASE = {
    "base commands beyond limits are refused",
    "velocities of a base lapse",
    "a base drives and turns by odometry",
    "a part can be stopped by itself",
}
"""What an arm and a gripper cannot promise; anything else that does not apply is a fault of the test."""


@pytest.mark.parametrize("check", [c for c in CHECKS if c.name not in NO_BASE], ids=lambda check: check.name)
def test_a_connected_ur_keeps_its_promise(check: Check, isolated_robot: IsolatedRobot) -> None:
    assert check.applies_to(isolated_robot)
    try:
        check.run(isolated_robot)
    finally:
        settle(isolated_robot)


def test_what_does_not_apply_is_known(isolated_robot: IsolatedRobot) -> None:
    assert {check.name for check in CHECKS if not check.applies_to(isolated_robot)} == NO_BASE
