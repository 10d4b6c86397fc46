"""Strict order of reactive nodes, halts that take several ticks, and warnings of leaves that are not made for them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    Condition,
    ManualClock,
    NodeRegistry,
    PortInformation,
    StatefulAction,
    Tree,
    TreeLoadError,
    load_tree,
    status_name,
)
from bestman_bt.engine.validation import validate_file

LATER = (
    '<ReactiveFallback {strict}><ReactiveSequence><ScriptCondition code="urgent"/><Act name="a"/></ReactiveSequence>'
    "{other}</ReactiveFallback>"
)


class Act(StatefulAction):
    def on_start(self) -> int:
        self.context.append(f"start {self.name}")
        return RUNNING

    def on_running(self) -> int:
        self.context.append(f"tick {self.name}")
        return RUNNING

    def on_halted(self) -> None:
        self.context.append(f"halt {self.name}")


class Slow(Act):
    """Takes ``ticks`` ticks to stop."""

    INPUT_PORTS = {"ticks": PortInformation(int, False, "", 2)}
    STOP_TIMEOUT = 1.0

    def on_halted(self) -> None:
        super().on_halted()
        self.left = self.get_input("ticks")

    def on_stopping(self) -> int:
        self.left -= 1
        self.context.append(f"stopping {self.name}" if self.left > 0 else f"stopped {self.name}")
        return RUNNING if self.left > 0 else IDLE


def loaded(body: str, **entries: Any) -> Tree:
    registry = NodeRegistry()
    registry.register(Act)
    registry.register(Slow)
    text = f'<root BTCPP_format="4"><BehaviorTree ID="M">{body}</BehaviorTree></root>'
    tree = load_tree(text, registry, context=[], clock=ManualClock())
    for key, value in entries.items():
        tree.blackboard.set(key, value)
    return tree


def ticked(tree: Tree, times: int = 1) -> list[str]:
    """What the leaves have said in the ticks, and the last result."""
    tree.context.clear()
    for _ in range(times):
        tree.clock.advance(0.05)
        status = tree.tick_exactly_once()
    return [*tree.context, status_name(status)]


@pytest.mark.parametrize("listened", [False, True])
@pytest.mark.parametrize(
    ("strict", "order"),
    [
        ("", ["start a", "halt b"]),
        ('_strict="false"', ["start a", "halt b"]),
        ('_strict="true"', ["halt b", "start a"]),
    ],
)
def test_beneath_a_strict_node_the_old_child_is_halted_first(strict: str, order: list[str], listened: bool) -> None:
    tree = loaded(LATER.format(strict=strict, other='<Act name="b"/>'), urgent=False)
    states: list[tuple[str, int]] = []
    if listened:
        tree.subscribe(lambda changes: states.extend((tree.nodes[uid - 1].name, state) for uid, state in changes))
    assert ticked(tree) == ["start b", "RUNNING"]
    states.clear()
    tree.blackboard["urgent"] = True
    assert ticked(tree) == [*order, "RUNNING"]
    assert ticked(tree) == ["tick a", "RUNNING"]
    assert [state for state in states if state[0] in "ab"] == (
        []
        if not listened
        else sorted([("a", RUNNING), ("b", IDLE)], key=lambda s: order.index(("start " if s[1] else "halt ") + s[0]))
    )


@pytest.mark.parametrize("listened", [False, True])
def test_what_displaces_an_action_starts_when_that_has_stopped(listened: bool) -> None:
    tree = loaded(LATER.format(strict='_strict="true"', other='<Slow name="b" ticks="3"/>'), urgent=False)
    states: list[tuple[str, int]] = []
    if listened:
        tree.subscribe(lambda changes: states.extend((tree.nodes[uid - 1].name, state) for uid, state in changes))
    ticked(tree)
    tree.blackboard["urgent"] = True
    assert ticked(tree) == ["halt b", "stopping b", "RUNNING"]
    assert ticked(tree) == ["stopping b", "RUNNING"]
    assert ticked(tree) == ["stopped b", "start a", "RUNNING"]
    assert ticked(tree) == ["tick a", "RUNNING"]
    assert [state for name, state in states if name == "a"] == ([RUNNING] if listened else [])


def test_a_leaf_that_waits_to_start_is_neither_halted_nor_started_when_it_is_interrupted() -> None:
    tree = loaded(LATER.format(strict='_strict="true"', other='<Slow name="b" ticks="9"/>'), urgent=False)
    ticked(tree)
    tree.blackboard["urgent"] = True
    ticked(tree)
    tree.blackboard["urgent"] = False
    assert ticked(tree) == ["stopping b", "RUNNING"]
    assert tree.node("a").state == IDLE
    tree.context.clear()
    tree.halt()
    assert not [word for word in tree.context if word.endswith(" a")]


def test_a_node_keeps_its_result_back_until_what_it_halted_has_stopped() -> None:
    body = '<Fallback><Timeout msec="40"><Slow name="b" ticks="3"/></Timeout><Act name="a"/></Fallback>'
    tree = loaded(body)
    assert ticked(tree) == ["start b", "RUNNING"]
    assert ticked(tree) == ["halt b", "stopping b", "RUNNING"]
    assert ticked(tree) == ["stopping b", "RUNNING"]
    assert ticked(tree) == ["stopped b", "start a", "RUNNING"]


def test_an_action_that_never_stops_is_waited_for_as_long_as_it_says(caplog: pytest.LogCaptureFixture) -> None:
    tree = loaded('<Timeout msec="40"><Slow name="b" ticks="1000"/></Timeout>')
    ticked(tree, 2)
    assert ticked(tree, 18)[-1] == "RUNNING"
    tree.clock.advance(0.1)
    assert ticked(tree)[-1] == "FAILURE"
    assert "b: it has not stopped within 1 s" in caplog.text


def test_after_a_halt_of_the_tree_its_end_can_be_waited_for() -> None:
    tree = loaded('<Slow name="b" ticks="4"/>')
    ticked(tree)
    tree.halt()
    assert tree.stopping.until
    before = tree.clock.now()
    tree.wait_until_stopped(0.1)
    assert not tree.stopping.until
    assert tree.clock.now() - before == pytest.approx(0.3)


def test_an_action_that_is_still_stopping_does_not_start_anew() -> None:
    tree = loaded(
        '<RetryUntilSuccessful num_attempts="2"><Timeout msec="40"><Slow name="b"/></Timeout></RetryUntilSuccessful>'
    )
    assert ticked(tree, 3) == ["start b", "halt b", "stopping b", "stopped b", "start b", "RUNNING"]


def test_strict_is_a_bool() -> None:
    with pytest.raises(TreeLoadError, match="'_strict': 'yes' is not a bool"):
        loaded('<ReactiveSequence _strict="yes"><AlwaysSuccess/></ReactiveSequence>')


class Odd(Condition):
    def on_tick(self) -> int:
        return RUNNING


class Careless(StatefulAction):
    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return SUCCESS if self.clock.now() else FAILURE


def test_leaves_that_are_not_made_for_a_reactive_node_are_warned_of(tmp_path: Path) -> None:
    registry = NodeRegistry()
    for kind in (Odd, Careless, Act):
        registry.register(kind)
    file = tmp_path / "tree.xml"
    file.write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence _strict="true"><Careless/><Odd/>\n'
        "<ReactiveSequence><Odd/>\n<Inverter><Careless/></Inverter>\n<Act/></ReactiveSequence></Sequence></BehaviorTree></root>"
    )
    told = [str(problem).removeprefix(f"{file}:") for problem in validate_file(file, registry)]
    assert told == [
        "1: warning: <Sequence> '_strict': it only affects ReactiveSequence and ReactiveFallback",
        "2: warning: <Odd>: a condition that may return RUNNING blocks the reactive node above it",
        "3: warning: <Careless>: a reactive node may halt it, and it does not define on_halted()",
    ]
