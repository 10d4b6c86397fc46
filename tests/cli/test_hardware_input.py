"""Wrong input for real robots: told in words, with exit code 2, before anything connects or a folder is made."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer

Command = Callable[..., Answer]
RUN = ("run", "pick_place_table", "--robot", "diff_xarm6", "--driver", "hardware")
NOBODY = "127.9.9.9"


def test_all_missing_addresses_are_reported_before_anything_connects(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt(*RUN)
    assert answer.code == 2
    assert "connections.arm_controller.address: is missing" in answer.err
    assert "connections.platform.address: is missing" in answer.err
    assert not list(folder.iterdir())


def test_a_robot_without_connections_is_reported_once(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt("run", "pick_place_table", "--robot", "diff_panda", "--driver", "hardware")
    assert answer.code == 2
    told = "started: diff_panda: connections: is missing, so the driver hardware has no part of diff_panda"
    assert answer.err.count(told) == 1
    assert "needs" not in answer.err
    assert not list(folder.iterdir())


def test_a_vendors_package_that_is_missing_is_reported_with_all_other_faults(
    bestman_bt: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarm", None)
    answer = bestman_bt(*RUN, "--set", "tick_rat=3")
    assert answer.code == 2
    assert "unknown key 'tick_rat'" in answer.err
    assert "diff_xarm6: connections.arm_controller.driver: needs the package 'xarm': pip install" in answer.err
    assert "connections.platform.address: is missing" in answer.err


@pytest.mark.slow
def test_a_controller_that_does_not_answer_is_reported_in_words_and_leaves_no_run(
    bestman_bt: Command, folder: Path
) -> None:
    settings = (
        f"robot.connections.arm_controller.address={NOBODY}",
        f"robot.connections.platform.address={NOBODY}",
        "robot.connections.arm_controller.options.connect_timeout=0.3",
    )
    answer = bestman_bt(*RUN, "--record", *(argument for setting in settings for argument in ("--set", setting)))
    assert answer.code == 2, answer.err
    assert "--record: writes no recording.rrd, only the readings for --driver replay" in answer.err
    assert (
        "safety: arms go at 10 % of their joints' speed and 0.25 m/s of the tool at most: no bring-up was signed"
        in answer.err
    )
    assert "bestman-bt: nothing was started: arm_controller" in answer.err
    assert "Traceback" not in answer.err
    assert NOBODY not in answer.err + answer.out
    assert not list((folder / "runs").iterdir())


def test_a_judge_that_is_not_there_is_reported_first(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt(*RUN, "--judge", "/nowhere")
    assert answer.code == 2
    assert "--judge /nowhere: no judge of twins answers there" in answer.err


def test_a_judge_of_a_simulated_robot_is_refused(bestman_bt: Command, folder: Path) -> None:
    answer = bestman_bt("run", "pick_place_table", "--judge", "/nowhere")
    assert answer.code == 2
    assert "needs --driver hardware" in answer.err


def test_a_release_reports_what_is_wrong_with_the_robot_before_it_asks_anybody(
    bestman_bt: Command, folder: Path
) -> None:
    for name, setting, words in (
        ("diff_panda", "robot.name=x", "name"),
        ("diff_panda", "scene.x=1", "should begin with robot."),
        ("diff_xarm6", f"robot.connections.platform.address={NOBODY}", "arm_controller.address: is missing"),
    ):
        answer = bestman_bt("robot", "release", name, "--yes", "--set", setting)
        assert answer.code == 2
        assert words in answer.err
    for verb in ("release", "wrist"):
        answer = bestman_bt("robot", verb, "diff_panda", "--yes")
        assert answer.code == 2
        assert "there is no controller" in answer.err
