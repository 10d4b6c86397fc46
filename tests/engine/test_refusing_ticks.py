"""A tree that refuses ticks ends the tick under way before the next leaf, whoever would have ticked that."""

from __future__ import annotations

from typing import ClassVar

import pytest

from bestman_bt.engine import (
    FAILURE,
    SUCCESS,
    EngineError,
    ManualClock,
    NodeRegistry,
    StateChanges,
    SyncAction,
    Tree,
    load_tree,
)


class Enough(SyncAction):
    """Refuses all ticks after its own."""

    RESULT: ClassVar[int] = SUCCESS

    def on_tick(self) -> int:
        self.owner.refuse_ticks()
        return self.RESULT


class EnoughOfThis(Enough):
    RESULT: ClassVar[int] = FAILURE


class Next(SyncAction):
    """What must not be ticked any more."""

    ticks = 0

    def on_tick(self) -> int:
        self.ticks += 1
        return SUCCESS


BODIES = [
    "<Sequence><Enough/><Next name='next'/></Sequence>",
    "<Fallback><EnoughOfThis/><Next name='next'/></Fallback>",
    "<ReactiveSequence><Enough/><Next name='next'/></ReactiveSequence>",
    "<ReactiveFallback><EnoughOfThis/><Next name='next'/></ReactiveFallback>",
    "<Parallel success_count='2'><Enough/><Next name='next'/></Parallel>",
    "<IfThenElse><Enough/><Next name='next'/><AlwaysFailure/></IfThenElse>",
    "<RecoveryNode number_of_retries='3'><EnoughOfThis/><Next name='next'/></RecoveryNode>",
    "<Sequence><Enough/><ForceSuccess><Inverter><Next name='next'/></Inverter></ForceSuccess></Sequence>",
    "<Sequence><Enough/><SubTree ID='Below'/></Sequence>",
    "<Repeat num_cycles='5'><Fallback><EnoughOfThis/><Next name='next'/></Fallback></Repeat>",
]


def tree_of(body: str, listening: bool) -> tuple[Tree, Next | None, list[StateChanges]]:
    registry = NodeRegistry()
    for node in (Enough, EnoughOfThis, Next):
        registry.register(node)
    below = "<Next name='next'/>" if "Below" in body else "<AlwaysSuccess/>"
    text = (
        f'<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main">{body}</BehaviorTree>'
        f'<BehaviorTree ID="Below">{below}</BehaviorTree></root>'
    )
    tree = load_tree(text, registry, clock=ManualClock())
    told: list[StateChanges] = []
    if listening:
        tree.subscribe(told.append)
    return tree, next((node for node in tree.nodes if isinstance(node, Next)), None), told


@pytest.mark.parametrize("listening", [False, True])
@pytest.mark.parametrize("body", BODIES)
def test_no_leaf_begins_after_it(body: str, listening: bool) -> None:
    tree, after, told = tree_of(body, listening)
    assert after is not None
    with pytest.raises(EngineError, match="cancelled"):
        tree.tick_exactly_once()
    with pytest.raises(EngineError, match="cancelled"):
        tree.tick_exactly_once()
    assert after.ticks == 0
    tree.halt()
    assert all(node.state == 0 for node in tree.nodes)
    assert not any(uid == after.uid for changes in told for uid, _ in changes)


@pytest.mark.parametrize("listening", [False, True])
def test_ticks_can_be_allowed_again(listening: bool) -> None:
    tree, after, _ = tree_of("<Sequence><Next name='next'/></Sequence>", listening)
    assert after is not None
    tree.refuse_ticks()
    with pytest.raises(EngineError, match="cancelled"):
        tree.tick_exactly_once()
    tree.halt()
    tree.allow_ticks()
    assert tree.tick_exactly_once() == SUCCESS
    assert after.ticks == 1


def test_a_listener_that_comes_or_goes_allows_nothing() -> None:
    tree, after, _ = tree_of("<Sequence><Next name='next'/></Sequence>", False)
    assert after is not None
    assert tree.tick_exactly_once() == SUCCESS
    tree.refuse_ticks()
    tree.subscribe(lambda changes: None)
    with pytest.raises(EngineError, match="cancelled"):
        tree.tick_exactly_once()
    assert after.ticks == 1
