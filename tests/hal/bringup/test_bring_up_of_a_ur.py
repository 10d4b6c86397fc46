"""A UR with a Robotiq gripper, over their twins: all steps pass, and with a fault planted, exactly one fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bestman_bt.bringup.procedure import run_step
from tests.hal.bringup.brought_up_twins import STEP, Pair, brought_up, fails_alone, passes

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]


@pytest.fixture(scope="module")
def ur() -> Iterator[Pair]:
    """All controllers of the shipped robot with a UR and a Robotiq gripper."""
    with brought_up("diff_ur5_robotiq", "rtde_control", "roslibpy") as pair:
        yield pair


def test_a_ur_with_a_robotiq_is_brought_up(ur: Pair, tmp_path: Path) -> None:
    file = passes(ur[0], tmp_path / "robot.bringup", set())
    assert file.serial_numbers == {"arm_controller": "20215500000"}
    assert {"arm, planner", "arm, robot process", "arm, SDK process"} <= set(file.steps["kill"].measured)


def test_where_a_urs_posture_does_not_show_its_mounting_the_step_says_where_to_move_it(ur: Pair) -> None:
    subject, _ = ur
    arm = subject.arms["arm"]
    home = arm.positions()
    assert subject.finish(arm.move_to([0.0, -np.pi / 2, 0.0, -np.pi / 2, 0.0, 0.0])) == ""
    try:
        result = run_step(subject, STEP["mounting"])
    finally:
        assert subject.finish(arm.move_to(home)) == ""
    assert result.outcome == "does not apply"
    assert "move it until its upper arm is upright and its forearm level" in result.text


FAULTS = [
    ("arm_controller", "other_length", "as_built", "tool-pose", "5.00 mm"),
    ("arm_controller", "other_mounting", "as_built", "mounting", "mounted as in the file, it needs"),
    ("arm_controller", "other_wrench_sign", "other_wrench_sign", "wrench", "the opposite sign"),
    ("hand_controller", "power_off", "power_on", "gripper", "does not become active"),
]


@pytest.mark.parametrize(("connection", "fault", "taken_back", "step", "words"), FAULTS)
def test_exactly_the_step_of_a_fault_in_the_urs_twins_fails(
    ur: Pair, connection: str, fault: str, taken_back: str, step: str, words: str
) -> None:
    fails_alone(*ur, (connection, fault, taken_back), step, words)
