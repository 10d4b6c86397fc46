"""A tree that is read again while it runs: what goes on, what waits, and what is refused."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from bestman_bt.engine import RUNNING, SUCCESS, ManualClock, Node, NodeRegistry, StatefulAction, Tree, load_tree
from bestman_bt.engine.reloading import WatchedTree, watched

began: list[str] = []


class Work(StatefulAction):
    """Runs for three ticks; an entry tells that it has ended."""

    def on_start(self) -> int:
        began.append(self.name)
        self.left = 3
        return RUNNING

    def on_running(self) -> int:
        self.left -= 1
        return SUCCESS if self.left == 0 else RUNNING

    def on_halted(self) -> None:
        began.append(f"{self.name} halted")


@pytest.fixture
def registry() -> NodeRegistry:
    began.clear()
    registry = NodeRegistry()
    registry.register(Work)
    return registry


def written(path: Path, body: str, more: str = "") -> None:
    """Write a tree of one Sequence with another time of change than before."""
    then = path.stat().st_mtime_ns + 1_000_000_000 if path.exists() else 1_000_000_000
    path.write_text(
        f'<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M"><Sequence name="all">{body}</Sequence>'
        f"</BehaviorTree>{more}</root>"
    )
    os.utime(path, ns=(then, then))


@pytest.fixture
def running(tmp_path: Path, registry: NodeRegistry) -> Callable[[str], tuple[Path, Tree, list[str]]]:
    def begin(body: str, more: str = "") -> tuple[Path, Tree, list[str]]:
        path, said = tmp_path / "t.xml", []
        written(path, body, more)
        clock = ManualClock()

        def load(replaces: Tree | None = None) -> Tree:
            return load_tree(path, registry, clock=clock, replaces=replaces)

        return path, watched(load(), load, said.append), said

    return begin


def inner(tree: Tree) -> Tree:
    assert isinstance(tree.root, WatchedTree)
    return tree.root.current


def state_of(tree: Tree, path: str) -> Node:
    return inner(tree).node(path)


def finish(tree: Tree) -> int:
    for _ in range(30):
        status = tree.tick_exactly_once()
        if status != RUNNING:
            return status
    return RUNNING


def test_a_running_node_goes_on_and_what_comes_later_is_new(running) -> None:
    path, tree, said = running('<Work name="a"/><Work name="b"/>')
    tree.tick_exactly_once()
    at_work = state_of(tree, "a")
    written(path, '<Work name="a"/><Work name="c"/><Work name="d"/>')
    assert finish(tree) == SUCCESS
    assert began == ["a", "c", "d"]
    assert inner(tree).nodes[1] is at_work
    assert [node.path for node in inner(tree).nodes] == ["all", "a", "c", "d"]
    assert [node.uid for node in inner(tree).nodes] == [1, 2, 3, 4]
    assert "2 of its 4 nodes" in said[0]


def test_entries_stay_also_in_a_subtree_that_runs(running) -> None:
    sub = '<BehaviorTree ID="S"><Sequence name="in"><Script code="mine := 7"/>{}</Sequence></BehaviorTree>'
    main = '<Script code="found := 5"/><SubTree ID="S" name="s" out="{{told}}" fixed="2"/>{}'
    path, tree, said = running(main.format(""), sub.format('<Work name="w"/>'))
    tree.tick_exactly_once()
    boards = dict(tree.blackboards)
    boards["s"]["fixed"] = 3
    written(
        path,
        main.format("<ScriptCondition code='told == 12'/>"),
        sub.format('<Work name="w"/><Script code="out := mine + fixed + 2"/>'),
    )
    assert finish(tree) == SUCCESS
    assert said
    assert began == ["w"]
    assert tree.blackboards["s"] is boards["s"]
    assert tree.blackboard["found"] == 5


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ('<Work name="b"/>', "the new tree has no node 'a'"),
        ('<Work name="z"/><Work name="a"/>', "has another place"),
        ('<AlwaysSuccess name="a"/>', "is now of the type AlwaysSuccess"),
        ('<Work name="a" _onSuccess="x := 1"/>', "its ports have changed"),
    ],
)
def test_a_change_of_what_runs_waits_for_its_end_and_is_reported_once(running, caplog, changed: str, why: str) -> None:
    path, tree, said = running(
        '<Repeat num_cycles="2" name="twice"><Sequence name="in"><Work name="a"/></Sequence></Repeat>'
    )
    tree.tick_exactly_once()
    written(path, f'<Repeat num_cycles="2" name="twice"><Sequence name="in">{changed}</Sequence></Repeat>')
    tree.tick_exactly_once()
    assert not said
    assert [why in record.message for record in caplog.records] == [True]
    assert "a (t.xml:1) is running" in caplog.text
    tree.tick_exactly_once()
    assert len(caplog.records) == 1
    assert finish(tree) == SUCCESS
    assert began[0] == "a"


def test_all_that_a_change_waits_for_is_reported_at_once(running, caplog) -> None:
    both = '<Parallel failure_count="2" name="both">{}</Parallel>'
    path, tree, said = running(both.format('<Work name="a"/><Work name="b"/>'))
    tree.tick_exactly_once()
    written(path, both.format('<Work name="c"/><AlwaysSuccess name="b"/>'))
    tree.tick_exactly_once()
    assert not said
    (record,) = caplog.records
    assert "the new tree has no node 'a'; b (t.xml:1) is running, and is now of the type" in record.message


def test_what_waits_is_taken_as_soon_as_the_node_has_ended(running) -> None:
    path, tree, said = running('<Work name="a"/><Work name="b"/><Work name="c"/>')
    tree.tick_exactly_once()
    written(path, '<Work name="z"/><Work name="b"/><Work name="d"/>')
    assert finish(tree) == SUCCESS
    assert said
    assert began == ["a", "b", "d"]


def test_a_broken_file_is_an_error_line_and_the_old_tree_goes_on(running, caplog) -> None:
    path, tree, said = running('<Work name="a"/><Work name="b"/>')
    tree.tick_exactly_once()
    written(path, '<Work name="a"/><Wrok name="b"/>')
    tree.tick_exactly_once()
    assert "did you mean 'Work'?" in caplog.text
    assert len(caplog.records) == 1
    written(path, '<Work name="a"/><Work name="c"/>')
    assert finish(tree) == SUCCESS
    assert began == ["a", "c"]
    assert len(said) == 1


def test_the_listeners_are_told_of_the_new_tree_and_that_the_old_one_is_idle(running) -> None:
    path, tree, _ = running('<Work name="a"/><Work name="b"/>')
    trees: list[Tree] = []
    told: dict[int, list[tuple[int, int]]] = {}

    def follow(one: Tree, leaf: Node) -> None:
        number = len(trees)
        trees.append(one)
        one.subscribe(lambda changes: told.setdefault(number, []).extend(changes))

    tree.subscribe_to_inner(follow)
    tree.tick_exactly_once()
    written(path, '<Work name="a"/><Work name="c"/>')
    finish(tree)
    assert trees[1] is inner(tree)
    assert told[0][-2:] == [(1, 0), (2, 0)]
    assert (3, RUNNING) in told[1]
    assert [node.name for node in trees[0].nodes] == ["all", "a", "b"]
    assert not any(node is other for node in trees[0].nodes for other in trees[1].nodes)


def test_a_halt_reaches_the_node_that_went_on(running) -> None:
    path, tree, _ = running('<Work name="a"/>')
    tree.tick_exactly_once()
    written(path, '<Work name="a"/><Work name="b"/>')
    tree.tick_exactly_once()
    tree.halt()
    assert began == ["a", "a halted"]
