"""One blackboard: native py_trees behaviours and our nodes read and write the same entries."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import py_trees
import pytest
from py_trees import behaviours, composites, decorators
from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard as PyTreesBlackboard
from py_trees.common import Access, Status

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    BlackboardError,
    NodeError,
    PortInformation,
    Script,
    ScriptCondition,
    Sequence,
    SubTree,
    SyncAction,
    build_tree,
    load_tree,
)
from bestman_bt.engine.validation import tree_warnings


@pytest.fixture(autouse=True)
def _own_py_trees_blackboard() -> Iterator[None]:
    PyTreesBlackboard.clear()  # trees of other tests may still be there
    yield
    PyTreesBlackboard.clear()
    PyTreesBlackboard.metadata.clear()


class Counts(Behaviour):
    """Adds one to ``steps``, which it reads first."""

    def __init__(self, name: str = "counts", access: Access = Access.WRITE) -> None:
        super().__init__(name)
        self.blackboard = self.attach_blackboard_client(name)
        self.blackboard.register_key("steps", access=access)

    def update(self) -> Status:
        self.blackboard.steps = (self.blackboard.steps if self.blackboard.exists("steps") else 0) + 1
        return Status.RUNNING


def test_what_a_native_leaf_writes_is_in_the_trees_blackboard_and_reported() -> None:
    tree = build_tree(Counts())
    told: list[tuple[str, Any, Any]] = []
    tree.blackboard.subscribe(None, lambda slot, previous: told.append((slot.key, previous, slot.value)))
    for _ in range(2):
        assert tree.tick_exactly_once() == RUNNING
    assert tree.blackboard["steps"] == 2
    assert tree.blackboard.entry("steps").sequence == 2
    assert told == [("steps", None, 1), ("steps", 1, 2)]
    assert PyTreesBlackboard.storage["/steps"] == 2
    assert [key for key in PyTreesBlackboard.storage if key.endswith("/steps")] == ["/steps"]


def test_setting_it_from_outside_reaches_the_leaf() -> None:
    tree = build_tree(Counts())
    tree.tick_exactly_once()
    tree.blackboard.set("steps", 40)
    tree.tick_exactly_once()
    assert tree.blackboard["steps"] == 41


def test_an_entry_that_only_one_client_may_write_cannot_be_set_and_the_error_reports_why() -> None:
    tree = build_tree(Counts("odometer", Access.EXCLUSIVE_WRITE))
    tree.tick_exactly_once()
    with pytest.raises(BlackboardError, match="'steps' cannot be set: the py_trees client 'odometer' has exclusive"):
        tree.blackboard.set("steps", 40)
    assert tree.blackboard["steps"] == 1


def test_our_nodes_see_at_once_what_their_native_parent_or_sibling_wrote() -> None:
    each = decorators.ForEach("each", ScriptCondition(code="item > 0"), "items", "item")
    PyTreesBlackboard.set("items", [1, 2])
    writer = behaviours.SetBlackboardVariable("write", "done", True, True)
    root = composites.Sequence("s", True, [writer, ScriptCondition(code="done"), each])
    tree = build_tree(root)
    assert tree.blackboard["items"] == [1, 2]  # was there before the tree
    assert tree.tick_while_running(period=0.0) == SUCCESS
    assert tree.blackboard["item"] == 2


def test_native_leaves_see_at_once_what_our_nodes_wrote_and_what_they_removed() -> None:
    check = behaviours.CheckBlackboardVariableExists("there", "a")
    unset = behaviours.UnsetBlackboardVariable("unset", "a")
    tree = build_tree(Sequence([Script(code="a := 3"), check, unset, ScriptCondition(code="true")]))
    assert tree.tick_exactly_once() == SUCCESS
    assert "a" not in tree.blackboard


def test_a_namespace_is_part_of_the_key() -> None:
    leaf = Counts()
    client = leaf.attach_blackboard_client("other", namespace="arm")
    client.register_key("busy", access=Access.WRITE)
    client.busy = True
    tree = build_tree(leaf)
    assert tree.blackboard["arm/busy"] is True


def test_a_native_leaf_in_a_subtree_uses_the_topmost_blackboard() -> None:
    tree = build_tree(SubTree(Sequence([Counts(), Script(code="mine := 1")]), name="sub"))
    tree.tick_exactly_once()
    assert tree.blackboard["steps"] == 1
    assert "steps" not in tree.blackboards["sub"]


class Adds(SyncAction):
    INPUT_PORTS = {"steps": PortInformation(int)}

    def on_tick(self) -> int:
        return SUCCESS if self.get_input("steps") else FAILURE


def test_the_type_of_a_port_holds_for_native_writers_and_other_entries_change_type() -> None:
    def writes(key: str, value: Any) -> Behaviour:
        return behaviours.SetBlackboardVariable("write", key, value, True)

    tree = build_tree(Sequence([writes("steps", "7"), Adds(steps="{steps}"), writes("free", 1), writes("free", "x")]))
    assert tree.tick_exactly_once() == SUCCESS
    assert (tree.blackboard["steps"], tree.blackboard["free"]) == (7, "x")
    tree = build_tree(Sequence([writes("steps", "many"), Adds(steps="{steps}")]))
    with pytest.raises(NodeError, match="write .*'steps' is locked to int"):
        tree.tick_exactly_once()


def test_the_type_of_a_port_holds_after_its_entry_was_cleared() -> None:
    class Clears(behaviours.Success):
        def update(self) -> Status:
            PyTreesBlackboard.storage.pop("/steps", None)
            return Status.SUCCESS

    first, second = (behaviours.SetBlackboardVariable("write", "steps", value, True) for value in (7, "many"))
    tree = build_tree(Sequence([first, Clears(), second, Adds(steps="{steps}")]))
    with pytest.raises(NodeError, match="write .*'steps' is locked to int"):
        tree.tick_exactly_once()


def test_setup_may_write_and_the_activity_stream_reports_each_write_once() -> None:
    class Opens(Counts):
        def setup(self, **kwargs: Any) -> None:
            self.blackboard.steps = 10

    tree = build_tree(Opens())
    tree.setup()
    assert tree.blackboard["steps"] == 10
    py_trees.blackboard.Blackboard.enable_activity_stream()
    try:
        tree.tick_exactly_once()
        items = PyTreesBlackboard.activity_stream.data
    finally:
        PyTreesBlackboard.disable_activity_stream()
    assert [item.activity_type for item in items if item.key == "/steps"].count("WRITE") == 1


def test_trees_without_native_behaviours_keep_their_entries_apart() -> None:
    tree = build_tree(Script(code="a := 1"))
    tree.tick_exactly_once()
    assert "/a" not in PyTreesBlackboard.storage
    assert tree.shared is None


def test_entries_that_a_tree_made_end_with_it_and_those_it_found_stay() -> None:
    PyTreesBlackboard.set("found", 1)
    tree = build_tree(Sequence([behaviours.Success("native"), Script(code="made := found")]))
    tree.tick_exactly_once()
    assert PyTreesBlackboard.storage == {"/found": 1, "/made": 1}
    del tree
    gc.collect()
    assert PyTreesBlackboard.storage == {"/found": 1}


def test_an_entry_that_a_native_leaf_may_write_is_not_warned_of() -> None:
    assert tree_warnings(build_tree(Sequence([Counts(), ScriptCondition(code="steps > 1")]))) == []


@pytest.mark.slow
def test_a_file_may_be_loaded_again_once_its_tree_is_gone(tmp_path: Path) -> None:
    file = tmp_path / "tree.py"
    file.write_text(
        "from py_trees.common import Access\n"
        "from tests.engine.test_shared_entries import Counts\n"
        "def build():\n    return Counts('odometer', Access.EXCLUSIVE_WRITE)\n"
    )
    for _ in range(2):
        tree = load_tree(file)
        assert "steps" not in tree.blackboard
        tree.tick_exactly_once()
        assert tree.blackboard["steps"] == 1
        del tree


def test_what_native_clients_have_registered_is_known_before_it_has_a_value() -> None:
    assert "steps" in build_tree(Sequence("main", [Counts()])).blackboard.registered()
    assert build_tree(Sequence("main", [Script(code="steps := 1")])).blackboard.registered() == []
