"""Unmodified trees of py_trees, watched by one line."""

from __future__ import annotations

import runpy
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees.common import Status

from bestman_bt.engine import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.monitor import watch
from bestman_bt.monitor.control_client import ControlError, request, running_executors
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import read
from tests.monitor.conftest import wait_until

EXAMPLE = Path(__file__).parents[2] / "examples" / "watched" / "patrol.py"


class Told(py_trees.behaviour.Behaviour):
    """Returns one after the other what it was told to."""

    def __init__(self, name: str, *results: Status) -> None:
        super().__init__(name)
        self._results = iter(results)

    def update(self) -> Status:
        self.feedback_message = f"{self.name} was ticked"
        return next(self._results)


@pytest.fixture(autouse=True)
def empty_blackboard() -> Iterator[None]:
    py_trees.blackboard.Blackboard.clear()
    yield
    py_trees.blackboard.Blackboard.clear()


def records(runs: Path) -> list[RunHistory]:
    return [read(folder) for folder in sorted(runs.iterdir())]


def ask(what: str) -> dict[str, Any]:
    (executor,) = running_executors()
    return request(executor, {"do": what})


def test_states_messages_and_failures_are_recorded_in_the_order_of_the_tick(tmp_path: Path) -> None:
    check = Told("CheckDoor", Status.SUCCESS, Status.SUCCESS)
    go = Told("go", Status.RUNNING, Status.FAILURE)
    root = py_trees.composites.Sequence("errand", memory=False, children=[check, go])
    tree = py_trees.trees.BehaviourTree(root)
    with watch(tree, runs=tmp_path):
        tree.tick()
        py_trees.blackboard.Blackboard.set("cups", 3)
        tree.tick()
        tree.interrupt()
    (history,) = records(tmp_path)
    assert [(node.path, node.type, node.category) for node in history.nodes] == [
        ("errand", "Sequence", "control"),
        ("errand/CheckDoor", "Told", "action"),
        ("errand/go", "Told", "action"),
    ]
    told = [(change.uid, change.status) for change in history.states.changes()]
    assert told == [(2, SUCCESS), (3, RUNNING), (1, RUNNING), (3, FAILURE), (1, FAILURE)]
    assert history.message_at(3, history.last) == "go was ticked"
    assert [(line.node, line.message) for _, line in history.log if line.node] == [("errand/go", "go was ticked")]
    assert history.entry_at("", "cups", history.last) is not None
    assert history.end is not None
    assert history.end["outcome"] == "failure"
    assert tree.post_tick_handlers == tree.pre_tick_handlers == []


def test_nodes_that_a_tick_resets_are_idle_and_a_changed_tree_is_another_run(tmp_path: Path) -> None:
    always = [Status.RUNNING] * 3
    root = py_trees.composites.Selector("root", memory=False, children=[Told("a", *always), Told("b", *always)])
    tree = py_trees.trees.BehaviourTree(root)
    with watch(tree, runs=tmp_path):
        tree.tick()
        root.stop(Status.INVALID)
        root.add_child(Told("c", *always))
        tree.tick()
    first, second = records(tmp_path)
    assert (len(first.nodes), len(second.nodes)) == (3, 4)
    assert first.end is not None
    assert first.end["why"] == "its nodes were changed"
    assert second.states.now.states[1:].tolist() == [RUNNING, RUNNING, IDLE, IDLE]


@pytest.mark.slow
def test_it_is_paused_and_stepped_between_ticks(tmp_path: Path) -> None:
    root = Told("forever", *[Status.RUNNING] * 1000)
    tree = py_trees.trees.BehaviourTree(root)
    with watch(tree, runs=None):
        ask("pause")
        thread = threading.Thread(target=lambda: [tree.tick() for _ in range(3)], daemon=True)
        thread.start()
        wait_until(lambda: bool(ask("status")["paused"]), "it waits")
        assert (tree.count, ask("status")["ticks"]) == (0, 0)
        ask("step")
        wait_until(lambda: tree.count == 1, "one tick")
        with pytest.raises(ControlError, match="can be paused and stepped from here, not 'stop'"):
            ask("stop")
        ask("resume")
        thread.join(60.0)
        assert tree.count == 3


def test_the_example_runs_and_leaves_a_run_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(EXAMPLE))["main"](4, 1)
    (history,) = records(tmp_path / "runs")
    assert [node.name for node in history.nodes] == ["patrol", "dock", "kitchen", "hall"]
    assert history.states.now.states[2] == SUCCESS
