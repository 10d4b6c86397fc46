"""A robot's twins are brought up like the robot: all steps pass, and with a fault planted, exactly one fails."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.bringup import STEPS, BroughtUpRobot, bring_up
from bestman_bt.robot_model.bringup_file import BringUpFile
from hal.twins import TwinProcess

pytestmark = [pytest.mark.real_time, pytest.mark.slow]
STEP = {step.name: step for step in STEPS}


@pytest.fixture(scope="module")
def xarm_twin() -> Iterator[TwinProcess]:
    """All controllers of the shipped robot with an xArm."""
    pytest.importorskip("xarm", reason="the extra xarm is not installed")
    pytest.importorskip("roslibpy", reason="the extra rosbridge is not installed")
    with TwinProcess("diff_xarm6", "pick_place_table", seed=1) as running:
        yield running


@pytest.fixture(scope="module")
def xarm(xarm_twin: TwinProcess) -> Iterator[BroughtUpRobot]:
    subject = BroughtUpRobot("diff_xarm6", xarm_twin.settings)
    with subject.robot:
        yield subject


def test_an_xarm_and_its_platform_are_brought_up(xarm: BroughtUpRobot, tmp_path: Path) -> None:
    path = tmp_path / "robot.bringup"
    results = {result.step: result for result in bring_up(xarm, path)}
    assert {name: result.outcome for name, result in results.items()} == dict.fromkeys(STEP, "passed"), results
    file = BringUpFile.read(path)
    assert file.signed is not None
    assert file.serial_numbers == {"arm_controller": "XI130400000000"}
    assert file.firmware == {"arm_controller": "2.5.0"}
    assert abs(file.steps["joint-signs"].measured["arm"]["joint2"]) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("connection", "fault", "taken_back", "step", "words"),
    [
        ("arm_controller", "other_tool", "as_built", "tool", r"\[0\.0, 0\.0, 5\.0\] mm from the flange"),
        ("arm_controller", "other_load", "as_built", "payload", "counts on 2.92 kg at the flange"),
        ("arm_controller", "other_mounting", "as_built", "mounting", "180.0° apart"),
        ("arm_controller", "other_length", "as_built", "tool-pose", "5.00 mm and 0.00° from our kinematics"),
        ("arm_controller", "turn_joint2", "as_commanded", "joint-signs", r"joint2 was told ([+-]).* moved (?!\1)"),
    ],
)
def test_exactly_the_step_of_a_planted_fault_fails(
    xarm: BroughtUpRobot,
    xarm_twin: TwinProcess,
    tmp_path: Path,
    connection: str,
    fault: str,
    taken_back: str,
    step: str,
    words: str,
) -> None:
    import re

    xarm_twin.fault(connection, fault)
    try:
        results = list(bring_up(xarm, tmp_path / "robot.bringup"))
    finally:
        xarm_twin.fault(connection, taken_back)
        xarm.make_ready()
    *before, failed = results
    assert {result.outcome for result in before} == {"passed"}
    assert (failed.step, failed.outcome) == (step, "failed"), failed.text
    assert re.search(words, failed.text), failed.text
    assert BringUpFile.read(tmp_path / "robot.bringup").signed is None


def test_another_controller_than_the_bring_up_was_begun_with_is_told(
    xarm: BroughtUpRobot, xarm_twin: TwinProcess, tmp_path: Path
) -> None:
    path = tmp_path / "robot.bringup"
    (first,) = bring_up(xarm, path, [STEP["identity"]])
    assert first.outcome == "passed"
    xarm_twin.fault("arm_controller", "other_serial")
    try:
        (second,) = bring_up(xarm, path, [STEP["identity"], STEP["limits"]])
    finally:
        xarm_twin.fault("arm_controller", "as_built")
    assert second.outcome == "failed"
    assert "XI130400000099" in second.text
    assert "was begun with XI130400000000" in second.text
