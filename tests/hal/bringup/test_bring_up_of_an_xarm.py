"""An xArm and its platform, over their twins: all steps pass, and with a fault planted, exactly one fails."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.bringup.procedure import bring_up
from bestman_bt.robot_model.bringup_file import BringUpFile
from tests.hal.bringup.brought_up_twins import WITHOUT_MOTION, Pair, brought_up, fails_alone, passes

pytestmark = [pytest.mark.real_time, pytest.mark.alone, pytest.mark.slow]


@pytest.fixture(scope="module")
def xarm() -> Iterator[Pair]:
    """All controllers of the shipped robot with an xArm."""
    with brought_up("diff_xarm6", "xarm", "roslibpy") as pair:
        yield pair


def test_an_xarm_and_its_platform_are_brought_up(xarm: Pair, tmp_path: Path) -> None:
    file = passes(xarm[0], tmp_path / "robot.bringup", set())
    assert file.serial_numbers == {"arm_controller": "XI130400000000"}
    assert file.firmware == {"arm_controller": "2.5.0"}
    assert abs(file.steps["joint-signs"].measured["arm"]["joint2"]) == pytest.approx(1.0, abs=0.3)
    assert 0.0 < file.steps["stopping"].measured["arm"]["way_rad_at_0.2"] < 0.3


FAULTS = [
    ("arm_controller", "other_tool", "as_built", "tool", r"\[0\.0, 0\.0, 5\.0\] mm from the flange"),
    ("arm_controller", "other_load", "as_built", "payload", "counts on 2.92 kg at the flange"),
    ("arm_controller", "other_mounting", "as_built", "mounting", "180.0° apart"),
    ("arm_controller", "other_length", "as_built", "tool-pose", "5.00 mm and 0.00° from our kinematics"),
    ("arm_controller", "turn_joint2", "as_commanded", "joint-signs", r"joint2 was commanded ([+-]).* moved (?!\1)"),
    ("arm_controller", "gripper_jam", "gripper_free", "gripper", "G34"),
    ("platform", "other_wrench_sign", "wrench_sign", "wrench", "the opposite sign"),
    ("platform", "no_dead_man", "dead_man", "dead-man", "has no dead-man"),
    (
        "platform",
        "stuck",
        "free",
        "drive",
        r"commanded 0\.2 m ahead, moved [+-]\d+ mm ahead.*remain at the end of the planned time",
    ),
]


@pytest.mark.parametrize(("connection", "fault", "taken_back", "step", "words"), FAULTS)
def test_exactly_the_step_of_a_fault_in_the_xarms_twins_fails(
    xarm: Pair, connection: str, fault: str, taken_back: str, step: str, words: str
) -> None:
    fails_alone(*xarm, (connection, fault, taken_back), step, words)


def test_a_step_that_has_failed_ends_the_bring_up_and_the_next_one_goes_on_there(xarm: Pair, tmp_path: Path) -> None:
    subject, twin = xarm
    path = tmp_path / "robot.bringup"
    twin.fault("arm_controller", "other_load")
    try:
        done = [result.step for result in bring_up(subject, path, WITHOUT_MOTION)]
    finally:
        twin.fault("arm_controller", "as_built")
    assert done == ["identity", "limits", "tool", "payload"]
    file = BringUpFile.read(path)
    assert (file.steps["payload"].outcome, file.signed) == ("failed", None)
    twin.fault("arm_controller", "other_serial")
    try:
        (again,) = bring_up(subject, path, WITHOUT_MOTION)
    finally:
        twin.fault("arm_controller", "as_built")
    assert again.outcome == "failed"
    assert "XI130400000099" in again.text
    assert "was started with XI130400000000" in again.text


def test_a_run_with_another_controller_than_was_signed_is_refused_before_anything_moves(
    xarm: Pair, tmp_path: Path
) -> None:
    subject, twin = xarm
    settings = [f"--set=robot.{key}={value}" for key, value in twin.settings.items()]
    command = [sys.executable, "-m", "bestman_bt.cli.main", "run", "pick_place_table", "--robot", "diff_xarm6"]
    command += ["--driver", "hardware", *settings, "--runs", str(tmp_path)]
    before = twin.judge("joints", "arm")["positions"]
    with subject.disconnected_robot():
        twin.fault("arm_controller", "other_serial")
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        finally:
            twin.fault("arm_controller", "as_built")
    assert done.returncode == 2, done.stderr
    assert "serial number is XI130400000099, that of the bring-up is XI130400000000" in done.stderr
    assert twin.judge("joints", "arm")["positions"] == pytest.approx(before, abs=2e-3)
