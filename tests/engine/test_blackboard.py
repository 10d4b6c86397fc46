"""Entries, their types, remapping, subscriptions, backup and JSON, and py_trees' view of it all."""

from __future__ import annotations

import gc
from collections import deque

import py_trees
import pytest

from bestman_bt.engine import (
    SUCCESS,
    Blackboard,
    BlackboardError,
    ManualClock,
    PortInformation,
    Script,
    Sequence,
    SyncAction,
    Tree,
    backup,
    build_tree,
    from_json,
    load_tree,
    restore,
    to_json,
)

SUBTREES = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Sequence>
  <Script code="near := 1; far := 'x'; _hidden := 5"/>
  <SubTree ID="Mapped" name="mapped" value="{near}" literal="7"/>
  <SubTree ID="Auto" name="auto" _autoremap="true"/>
</Sequence></BehaviorTree>
<BehaviorTree ID="Mapped"><Script code="value += 1; own := literal + 1; @top := 'root'"/></BehaviorTree>
<BehaviorTree ID="Auto"><Script code="far += 'y'; fresh := 3; _hidden := 6"/></BehaviorTree>
</root>"""


@pytest.fixture
def tree() -> Tree:
    tree = load_tree(SUBTREES, clock=ManualClock(2.5))
    assert tree.tick_exactly_once() == SUCCESS
    return tree


def test_a_remapped_key_is_the_entry_outside(tree: Tree) -> None:
    assert tree.blackboard["near"] == 2
    assert tree.blackboards["mapped"].items() == [("literal", 7), ("own", 8.0)]


def test_autoremap_shares_all_but_private_keys(tree: Tree) -> None:
    assert tree.blackboard["far"] == "xy"
    assert tree.blackboard["fresh"] == 3
    assert (tree.blackboard["_hidden"], tree.blackboards["auto"]["_hidden"]) == (5, 6)


def test_an_at_sign_reaches_the_topmost_blackboard(tree: Tree) -> None:
    assert tree.blackboard["top"] == "root"


def test_an_entry_knows_its_sequence_number_and_the_clock_time_of_its_last_write(tree: Tree) -> None:
    entry = tree.blackboard.entry("near")
    assert (entry.value, entry.sequence, entry.stamp) == (2, 2, 2.5)
    with pytest.raises(BlackboardError, match="no entry 'absent' .entries here: _hidden, far, fresh, near, top"):
        tree.blackboard.entry("absent")


def test_the_first_typed_value_locks_an_entry() -> None:
    board = Blackboard("lock")
    board.set("n", 1)
    board.set("n", 2.0)
    assert board["n"] == 2
    assert isinstance(board["n"], int)
    with pytest.raises(BlackboardError, match="entry 'n' is locked to int"):
        board.set("n", 2.5)
    board.unset("n")
    board.set("n", "now a text")
    assert board["n"] == "now a text"


def test_a_text_from_outside_locks_only_an_entry_that_is_there_already() -> None:
    board = Blackboard("texts")
    board.set("n", "5")
    board.set("n", 6)
    with pytest.raises(BlackboardError, match="entry 'n' is locked to int"):
        board.set("n", [1])
    board.set("t", "a")
    board.set("t", "b")
    with pytest.raises(BlackboardError, match="entry 't' is locked to str and cannot take 3"):
        board.set("t", 3)
    board.set("t", None)
    assert (board.get("t"), board.entry("t").type) == (None, "str")


def test_what_was_unset_begins_to_count_anew_and_is_no_entry(tree: Tree) -> None:
    tree.blackboard.unset("near")
    assert "near" not in tree.blackboard
    assert tree.blackboard.get("near", 7) == 7
    tree.blackboards["mapped"].unset("value")  # leads outside: stays
    tree.blackboard.set("near", "text")
    entry = tree.blackboard.entry("near")
    assert (entry.value, entry.sequence) == ("text", 1)


def test_a_missing_entry_is_an_error_by_index_and_a_default_by_get() -> None:
    board = Blackboard("missing")
    board.set("known", 1)
    assert board.get("unknown", 3) == 3
    with pytest.raises(BlackboardError, match="entry 'unknown' has no value .entries here: known"):
        board["unknown"]


def test_watchers_see_each_write_with_the_value_before_it(tree: Tree) -> None:
    seen: list[tuple[str, object, object]] = []
    end = tree.blackboard.subscribe("near", lambda slot, previous: seen.append((slot.key, previous, slot.value)))
    end_all = tree.blackboard.subscribe(None, lambda slot, previous: seen.append(("any", previous, slot.value)))
    tree.blackboard.set("near", 9)
    assert seen == [("near", 2, 9), ("any", 2, 9)]
    end()
    end_all()
    tree.blackboard.set("near", 10)
    assert len(seen) == 2


def test_a_watcher_of_all_keys_added_within_a_tick_sees_the_next_write_of_that_tick() -> None:
    seen: list[tuple[str, object]] = []

    class Watch(SyncAction):
        def on_tick(self) -> int:
            self.end = self.board.subscribe(None, lambda slot, previous: seen.append((slot.key, slot.value)))
            return SUCCESS

    watch = Watch()
    build_tree(Sequence([Script(code="a := 1"), watch, Script(code="b := 2")])).tick_exactly_once()
    assert seen == [("b", 2.0)]


def test_two_trees_in_one_process_share_nothing() -> None:
    first, second = load_tree(SUBTREES), load_tree(SUBTREES)
    first.tick_exactly_once()
    assert first.blackboard["near"] == 2
    assert second.blackboard.items() == []


def test_a_given_blackboard_is_the_root_and_its_parent_is_reached_by_at() -> None:
    above = Blackboard("above")
    above.set("world", "kitchen")
    board = Blackboard("Main", above)
    text = '<root BTCPP_format="4"><BehaviorTree ID="Main"><Script code="copy := @world"/></BehaviorTree></root>'
    load_tree(text, blackboard=board).tick_exactly_once()
    assert board["copy"] == "kitchen"


def test_a_backup_restores_values_and_removes_entries_made_since(tree: Tree) -> None:
    tree.blackboard.set("queue", deque([1, 2]))
    saved = backup(tree)
    tree.blackboard["queue"].popleft()
    tree.blackboard.set("near", 99)
    tree.blackboard.set("later", 1)
    restore(tree, saved)
    assert list(tree.blackboard["queue"]) == [1, 2]
    assert tree.blackboard["near"] == 2
    assert "later" not in tree.blackboard


def test_a_backup_keeps_the_types_of_entries_and_leaves_unmade_ones_unmade(tree: Tree) -> None:
    board = tree.blackboard
    board.unset("fresh")
    board.set("queue", deque([1]))
    board.set("count", 4)
    saved = backup(tree)
    board.unset("count")
    board.set("count", "text")
    board.set("fresh", 1)
    for _ in range(2):
        restore(tree, saved)
        assert (board["count"], "fresh" in board, list(board["queue"])) == (4, False, [1])
        assert list(tree.blackboards["mapped"]) == ["literal", "own"]
        board["queue"].append(3)
    board.set("count", 5.0)
    assert type(board["count"]) is int


class Spot:
    """A place on a line."""

    def __init__(self, x: float) -> None:
        self.x = x

    @classmethod
    def from_string(cls, text: str) -> Spot:
        return cls(float(text))

    def to_string(self) -> str:
        return repr(self.x)


class Visit(SyncAction):
    INPUT_PORTS = {"spot": PortInformation(Spot), "any": PortInformation(object, False)}

    def on_tick(self) -> int:
        return SUCCESS


def test_values_of_own_types_lists_and_queues_go_through_json() -> None:
    tree, again = (build_tree(Visit(spot="{spot}", any="{other}")) for _ in range(2))
    values = {"yes": True, "n": 3, "x": 0.5, "t": "text", "list": [1, [2]], "table": {"a": 1}}
    for key, value in {**values, "queue": deque([1, 2]), "pair": (3, 4), "spot": Spot(1.25)}.items():
        tree.blackboard.set(key, value)
    from_json(again, to_json(tree))
    found = dict(again.blackboard.items())
    assert found.pop("spot").x == 1.25
    assert found.pop("other") is None
    assert found == {**values, "queue": [1, 2], "pair": [3, 4]}
    assert found["yes"] is True
    tree.blackboard.set("other", Spot(2.0))
    with pytest.raises(BlackboardError, match="other' holds a Spot, which no port in the tree declares"):
        from_json(again, to_json(tree))
    tree.blackboard.set("thing", object())
    with pytest.raises(BlackboardError, match="thing' cannot be exported"):
        to_json(tree)


def test_a_backup_of_another_tree_is_refused(tree: Tree) -> None:
    other = load_tree('<root BTCPP_format="4"><BehaviorTree ID="M"><AlwaysSuccess/></BehaviorTree></root>')
    with pytest.raises(BlackboardError, match="has the SubTrees"):
        restore(tree, backup(other))


def test_blackboards_go_through_json_and_back(tree: Tree) -> None:
    text = to_json(tree)
    fresh = load_tree(SUBTREES)
    from_json(fresh, text)
    assert [board.items() for board in fresh.blackboards.values()] == [
        board.items() for board in tree.blackboards.values()
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("[]", "object of objects"),
        ('{"Other": {}}', "there are no SubTrees"),
        ('{"Main": 3}', "object"),
        ('{"Main": {}, "mapped": []}', "object of objects"),
    ],
)
def test_wrong_json_is_refused(text: str, message: str, tree: Tree) -> None:
    with pytest.raises(BlackboardError, match=message):
        from_json(tree, text)


def test_py_trees_shows_the_entries_under_the_trees_name() -> None:
    tree = load_tree(SUBTREES.replace('"Main"', '"Shown"'))
    tree.tick_exactly_once()
    text = py_trees.display.unicode_blackboard()
    assert "/Shown/near" in text
    assert "/Shown/mapped/own" in text


def test_a_discarded_tree_leaves_py_trees_blackboard() -> None:
    tree = load_tree(SUBTREES.replace('"Main"', '"Gone"'))
    tree.tick_exactly_once()
    assert any(key.startswith("/Gone") for key in py_trees.blackboard.Blackboard.storage)
    del tree
    gc.collect()
    assert not any(key.startswith("/Gone") for key in py_trees.blackboard.Blackboard.storage)


def test_py_trees_activity_stream_shows_the_writes() -> None:
    py_trees.blackboard.Blackboard.enable_activity_stream()
    try:
        load_tree(SUBTREES.replace('"Main"', '"Streamed"')).tick_exactly_once()
        items = py_trees.blackboard.Blackboard.activity_stream.data
        writes = [(item.key, item.activity_type, item.current_value) for item in items if "/Streamed/near" in item.key]
    finally:
        py_trees.blackboard.Blackboard.disable_activity_stream()
    assert writes == [("/Streamed/near", "INITIALISED", 1), ("/Streamed/near", "WRITE", 2)]


@pytest.mark.parametrize("key", ["", "@", "@@a", "a@b@c"])
def test_what_is_no_key_is_refused(key: str) -> None:
    with pytest.raises(BlackboardError, match="is not a key"):
        Blackboard("keys").set(key, 1)
