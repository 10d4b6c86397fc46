"""``bestman-bt explain RUN`` tells what a motion failed at, from the files of the run."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from behaviours.failure import NodeFailure
from bestman_bt.evaluation.result import RunResult
from bestman_bt.messages import MotionObstacle, MotionStage
from bestman_bt.records.events import ImageEvent, LogEvent
from tests.cli.command_line import Answer
from tests.evaluation.report.run_folders import write_run

Command = Callable[..., Answer]
MET = MotionObstacle(MotionStage.PATH, (("panda_hand", "table"),), positions={"panda_joint1": 0.25})
TOLD = LogEvent(1.5, "warning", "found no path", "fetch/MoveArm", "no_path", where="MoveArm (t.xml:3)", obstacle=MET)
PICTURE = ImageEvent(1.5, "scene", 840, 460, file="pictures/01-scene.jpg", node="fetch/MoveArm")


def failed_run(folder: Path) -> Path:
    """A run whose MoveArm found no path, after which the tree failed."""
    write_run(folder, success=False, events=(TOLD, PICTURE))
    result = RunResult.from_document(json.loads((folder / "result.json").read_text()))
    failure = NodeFailure("fetch/MoveArm", "no_path", "found no path", "MoveArm (t.xml:3)", 101.5, "", "", MET)
    replace(result, failure=failure).write(folder / "result.json")
    return folder


def test_a_failure_is_reported_with_what_was_in_the_way_the_pose_and_the_picture(
    bestman_bt: Command, folder: Path
) -> None:
    answer = bestman_bt("explain", failed_run(folder / "run"))
    assert answer.code == 0
    for said in (
        "fetch_cup, seed 1: failure",
        "MoveArm (t.xml:3)",
        "no_path",
        "stage       path",
        "in the way  panda_hand with table",
        "panda_joint1 0.250",
        "01-scene.jpg",
    ):
        assert said in answer.out
    assert answer.out.count("found no path") == 1
    document = json.loads(bestman_bt("explain", folder / "run", "--json").out)
    assert document["failure"]["obstacle"]["pairs"] == [["panda_hand", "table"]]


def test_a_result_with_what_a_motion_met_is_read_as_it_was_written(folder: Path) -> None:
    document = json.loads((failed_run(folder / "run") / "result.json").read_text())
    assert RunResult.from_document(document).failure.obstacle == MET


def test_a_run_without_failure_and_one_that_was_killed_report_it(bestman_bt: Command, folder: Path) -> None:
    write_run(folder / "good")
    answer = bestman_bt("explain", folder / "good")
    assert (answer.code, "nothing failed" in answer.out) == (0, True)
    write_run(folder / "killed", killed=True, events=(TOLD,))
    answer = bestman_bt("explain", folder / "killed")
    assert answer.code == 0
    assert "interrupted" in answer.out
    assert "panda_hand with table" in answer.out


def test_what_is_no_run_is_refused(bestman_bt: Command, folder: Path) -> None:
    (folder / "empty").mkdir()
    broken = write_run(folder / "broken")
    (broken / "result.json").write_text("{")
    for path, why in (
        ("none", "is not a folder"),
        ("empty", "is not a run folder"),
        ("broken", "is not a result of a run"),
    ):
        answer = bestman_bt("explain", path)
        assert (answer.code, why in answer.err) == (2, True)
