"""A robot that was stopped in the middle of a motion goes on where the tree says so, and nowhere else."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from bestman_bt.control.robot_stop import RobotStop
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import Arm, RobotError
from tests.behaviours.at_the_table import failures_of, fastest, tick, tree_of

PAGE = Path(__file__).resolve().parents[2] / "docs" / "hardware.md"
EXAMPLES = re.findall(r"^```xml\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL)
MOVE = '<MoveArm posture="home"/>'


def stopped_on_the_way(session: RobotSession, text: str, stops: int = 1) -> int:
    """Tick a tree to its end; so many times, as soon as the robot moves, it is stopped as by a controller of its."""
    tree = session.load(text)
    status = RUNNING
    while status == RUNNING:
        status = tick(tree)
        if stops and not session.robot.stopped and fastest(session) > 0.1:
            session.robot.stop()
            stops -= 1
    assert not stops, "the robot never moved"
    return status


def at_home(session: RobotSession) -> bool:
    arm = session.robot.part("arm", Arm)
    return arm.positions() == pytest.approx(session.robot.model.posture("home", arm.joint_names), abs=0.02)


def refusing(session: RobotSession, times: int, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """When the stop was to be cleared; the first so many times a button is pressed."""
    clear: Callable[[], None] = session.robot.clear_stop
    asked: list[float] = []

    def clear_stop() -> None:
        asked.append(session.robot.clock.now())
        if len(asked) <= times:
            raise RobotError("arm_controller: the emergency button has to be released at the robot")
        clear()

    monkeypatch.setattr(session.robot, "clear_stop", clear_stop)
    return asked


@pytest.mark.slow
@pytest.mark.parametrize(("example", "stops"), [pytest.param(0, 1, marks=pytest.mark.slow), (0, 2), (1, 1)])
def test_the_examples_of_the_docs_get_there_after_stops(at_table: RobotSession, example: int, stops: int) -> None:
    assert stopped_on_the_way(at_table, EXAMPLES[example], stops) == SUCCESS
    assert at_home(at_table)
    assert [failure.error_code for failure in at_table.skills.failures] == ["stopped"] * stops


@pytest.mark.slow
def test_it_gives_up_when_it_is_stopped_again_and_again(at_table: RobotSession) -> None:
    assert stopped_on_the_way(at_table, EXAMPLES[0], 3) == FAILURE
    assert not at_home(at_table)


@pytest.mark.slow
def test_without_the_leaf_a_stop_stays(at_table: RobotSession) -> None:
    retry = f'<RetryUntilSuccessful num_attempts="3">{MOVE}</RetryUntilSuccessful>'
    assert stopped_on_the_way(at_table, tree_of(retry)) == FAILURE
    assert at_table.robot.stopped


def test_it_waits_between_attempts_and_clears_as_soon_as_that_is_possible(
    at_table: RobotSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = refusing(at_table, 2, monkeypatch)
    at_table.robot.stop()
    assert tick(at_table.load(tree_of('<ClearStop attempts="4" wait="1.5"/>')), 200) == SUCCESS
    assert not at_table.robot.stopped
    assert len(asked) == 3
    assert [b - a for a, b in pairwise(asked)] == pytest.approx([1.6, 1.6], abs=0.11)


@pytest.mark.slow
def test_a_stop_that_cannot_be_cleared_is_reported_with_its_reason(
    at_table: RobotSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = refusing(at_table, 99, monkeypatch)
    at_table.robot.stop()
    assert tick(at_table.load(tree_of('<ClearStop attempts="2" wait="0.5"/>')), 100) == FAILURE
    assert len(asked) == 2
    ((code, words),) = failures_of(at_table)
    assert code == "still_stopped"
    assert "after 2 attempts" in words
    assert "released at the robot" in words
    assert at_table.robot.stopped


def test_a_robot_that_is_not_stopped_needs_no_clearing(at_table: RobotSession, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = refusing(at_table, 0, monkeypatch)
    assert at_table.load(tree_of("<ClearStop/>")).tick_once() == SUCCESS
    assert not asked


def test_clearing_moves_nothing(at_table: RobotSession) -> None:
    tree = at_table.load(tree_of(MOVE))
    while fastest(at_table) < 0.1:
        assert tick(tree) == RUNNING
    at_table.robot.stop()
    tree.halt()
    at_table.robot.clock.sleep(0.6)
    assert tick(at_table.load(tree_of("<ClearStop/>")), 20) == SUCCESS
    at_table.robot.clock.sleep(0.5)
    assert fastest(at_table) < 0.02


def test_a_stop_that_a_person_asked_for_is_not_cleared(at_table: RobotSession, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = refusing(at_table, 0, monkeypatch)
    monkeypatch.setattr(at_table.skills, "stop", RobotStop(at_table.robot))  # held for good: a stop of its own
    at_table.skills.stop.hold()
    assert tick(at_table.load(tree_of('<ClearStop attempts="2" wait="0.5"/>')), 100) == FAILURE
    ((code, words),) = failures_of(at_table)
    assert code == "still_stopped"
    assert "requested by a person" in words
    assert not asked
    assert at_table.robot.stopped
