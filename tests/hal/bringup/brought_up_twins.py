"""What the tests share that bring twins up."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bestman_bt.bringup.brought_up_robot import BroughtUpRobot
from bestman_bt.bringup.procedure import STEPS, bring_up, run_step
from bestman_bt.bringup.sensors import board_in_view
from bestman_bt.cli.options import pose
from bestman_bt.robot_model.bringup_file import BringUpFile
from bestman_bt.robot_model.compose import load_robot_model
from hal.twins.process import TwinProcess
from tests.hal.twinned import twin_settings

STEP = {step.name: step for step in STEPS}
WITHOUT_MOTION = [step for step in STEPS if not step.moves and step.name != "camera"]
"""Images of twins are late where the machine is busy."""
Pair = tuple[BroughtUpRobot, TwinProcess]


@contextmanager
def brought_up(robot: str, *packages: str) -> Iterator[Pair]:
    """A robot of shipped name or file, connected to twins of its own."""
    for package in packages:
        pytest.importorskip(package, reason="an extra is not installed")
    board = board_in_view(load_robot_model(robot))
    with TwinProcess(robot, "pick_place_table", seed=1, board=board) as twin:
        base_from_board = None if board is None else pose("--board", board)
        subject = BroughtUpRobot(robot, twin_settings(twin), base_from_board=base_from_board)
        with subject.robot:
            yield subject, twin


def passes(subject: BroughtUpRobot, path: Path, without: set[str]) -> BringUpFile:
    """All steps pass, and leave the arms where they were; ``without``: but those that do not apply, with a reason."""
    before = {name: arm.positions() for name, arm in subject.arms.items()}
    results = {result.step: result for result in bring_up(subject, path)}
    owed = {name: "does not apply" if name in without else "passed" for name in STEP}
    assert {name: result.outcome for name, result in results.items()} == owed, results
    assert all(finding.text for result in results.values() for finding in result.findings)
    for name, arm in subject.arms.items():
        assert arm.positions() == pytest.approx(before[name], abs=0.005)
    file = BringUpFile.read(path)
    assert file.signed is not None
    assert ("head_camera, frame" in file.steps["camera"].measured) is ("camera" not in without)
    return file


def fails_alone(
    subject: BroughtUpRobot, twin: TwinProcess, planted: tuple[str, str, str], step: str, words: str
) -> None:
    """That step, with these words; of the others those without motion are done."""
    connection, fault, taken_back = planted
    twin.fault(connection, fault)
    try:
        results = [run_step(subject, one) for one in (*WITHOUT_MOTION, *([STEP[step]] if STEP[step].moves else []))]
    finally:
        twin.fault(connection, taken_back)
        subject.make_ready()
    failed = {result.step: result.text for result in results if result.outcome == "failed"}
    assert set(failed) == {step}, failed
    assert re.search(words, failed[step]), failed[step]
