"""A tree that was halted begins anew as one that was never ticked, whatever runs in it and whoever listens."""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass, field
from typing import Any

import pytest

from bestman_bt.engine import (
    RUNNING,
    EngineError,
    ManualClock,
    NodeRegistry,
    StatefulAction,
    Tree,
    TreeLoadError,
    load_tree,
    status_name,
)
from tests.engine.planned_leaves import LETTERS

EXAMPLES = 12
TICKS = 9
PERIOD = 1 / 16  # exact in every sum
# Left out: RoundRobin, SequenceWithMemory, RunOnce and Precondition, which keep something over a halt on purpose.
CONTROLS: dict[str, tuple[int, int, str]] = {
    "Sequence": (2, 3, ""),
    "AsyncSequence": (2, 3, ""),
    "Fallback": (2, 3, ""),
    "AsyncFallback": (2, 3, ""),
    "ReactiveSequence": (2, 3, ""),
    "ReactiveFallback": (2, 3, ""),
    "Parallel": (3, 4, ' success_count="2" failure_count="3"'),
    "ParallelAll": (3, 4, ' max_failures="2"'),
    "IfThenElse": (3, 3, ""),  # with two, a condition that failed is not asked anew, as in BehaviorTree.CPP
    "WhileDoElse": (2, 3, ""),
    "Switch3": (4, 4, ' variable="{n}" case_1="1" case_2="3" case_3="4"'),
    "TryCatch": (2, 3, ' catch_on_halt="true"'),
    "PipelineSequence": (2, 3, ""),
    "RecoveryNode": (2, 2, ' number_of_retries="2"'),
}
ITEMS = ("item", "index", "text")
DECORATORS = {
    "Inverter": "",
    "Repeat": ' num_cycles="3"',
    "RetryUntilSuccessful": ' num_attempts="3"',
    "KeepRunningUntilFailure": "",
    "Timeout": ' msec="120"',
    "Delay": ' delay_msec="70"',
    "RateController": ' hz="8"',
    "ForEach": ' items="{list}" item="{item}" index="{index}"',
    "LoopInt": ' queue="{list}" value="{item}"',
    "LoopString": ' queue="a;b;c" value="{text}"',
    "ConsumeQueue": ' queue="{queue}" popped_item="{item}"',
    "SubTree": "",
}


@dataclass
class Script:
    """What leaves return, by their name and by how many ticks the tree has had since it began."""

    seed: int
    tick: int = 0
    calls: list[Any] = field(default_factory=list)

    def letter(self, name: str) -> str:
        return random.Random(f"{self.seed} {name} {self.tick}").choice("RRRSSFFK")


class Act(StatefulAction):
    def on_start(self) -> int:
        return self._next("start")

    def on_running(self) -> int:
        return self._next("running")

    def on_halted(self) -> None:
        self.context.calls.append(("halted", self.name))

    def _next(self, what: str) -> int:
        self.context.calls.append((what, self.name, *(self.board.get(key) for key in ITEMS)))
        return LETTERS[self.context.letter(self.name)]


def random_tree(rng: random.Random, must_hold: str) -> str:
    """A tree three levels deep, with a node of one kind in its middle."""
    subtrees: list[str] = []

    def node(depth: int, kind: str | None = None) -> str:
        number = rng.randrange(10**6)
        kind = kind or rng.choice(["Act", "Act", *CONTROLS, *DECORATORS] if depth else ["Act"])
        if kind == "Act":
            return f'<Act name="leaf{number}"/>'
        if kind == "SubTree":
            subtrees.append(f'<BehaviorTree ID="Sub{number}">{node(depth - 1)}</BehaviorTree>')
            return f'<SubTree ID="Sub{number}" _autoremap="true"/>'
        if kind in DECORATORS:
            return f"<{kind}{DECORATORS[kind]}>{node(depth - 1)}</{kind}>"
        low, high, ports = CONTROLS[kind]
        children = [node(depth - 1) for _ in range(rng.randint(low, high))]
        if kind == "ReactiveSequence":  # it refuses two that run at once, and what yields
            children = [child.replace("AsyncSequence", "Sequence") for child in children]
        return f"<{kind}{ports}>{''.join(children)}</{kind}>"

    body = node(2, must_hold)
    return (
        '<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><WhileDoElse>'
        f'<ScriptCondition code="goes_on"/>{body}<AlwaysFailure/></WhileDoElse></BehaviorTree>'
        f"{''.join(subtrees)}</root>"
    )


def begin(xml: str, seed: int, *, logged: bool, at: float) -> Tree:
    registry = NodeRegistry()
    registry.register(Act)
    tree = load_tree(xml, registry, context=Script(seed), clock=ManualClock(at))
    if logged:
        tree.subscribe(lambda changes: None)
    return tree


def running(tree: Tree) -> list[str]:
    return [node.path for node in tree.nodes if node.state == RUNNING]


def execution(tree: Tree, count: int) -> list[Any]:
    """What at most ``count`` ticks do, and the halt after them, which comes from within the tree."""
    script: Script = tree.root.context
    board = tree.blackboard
    for key in (*ITEMS, "list", "queue"):
        board.unset(key)
    board.set("list", [1, 2, 3])
    board.set("queue", deque([4, 5]))
    script.calls.clear()
    told: list[Any] = []
    for script.tick in range(count + 1):
        board.set("goes_on", script.tick < count)
        board.set("n", str(script.tick // 2))
        try:
            result = status_name(tree.tick_exactly_once())
        except EngineError as error:
            told.append(str(error))
            tree.halt()
            break
        told.append((result, running(tree), board.get("item"), len(board["queue"])))
        tree.clock.advance(PERIOD)
        if result == "SKIPPED":  # nodes above may go on from there
            tree.halt()
        if result != "RUNNING":
            break
    assert running(tree) == []
    return [*told, *script.calls]


@pytest.mark.parametrize("kind", [*CONTROLS, *DECORATORS])
def test_a_tree_that_was_halted_or_has_ended_begins_anew(kind: str) -> None:
    rng = random.Random(kind)
    tried = 0
    for seed in range(EXAMPLES):
        xml = random_tree(rng, kind)
        try:
            tree = begin(xml, seed, logged=False, at=0.0)
        except TreeLoadError:  # a ReactiveSequence refuses more than one child that yields
            continue
        tried += 1
        for count in rng.sample(range(1, TICKS), 3):
            fresh = execution(begin(xml, seed, logged=False, at=50.0), count)
            assert execution(tree, count) == fresh, xml
            assert execution(begin(xml, seed, logged=True, at=7.0), count) == fresh, xml
            tree.clock.advance(1 / 32)
    assert tried > EXAMPLES // 2


def test_the_status_of_a_tree_prints_its_name_and_equals_the_constant() -> None:
    tree = load_tree('<root BTCPP_format="4"><BehaviorTree ID="Main"><Sleep msec="1"/></BehaviorTree></root>')
    told = [str(tree.status)]
    for change in (tree.tick_once, tree.halt):
        change()
        told.append(f"{tree.status}")
    assert told == ["IDLE", "RUNNING", "IDLE"]
    assert [f"{tick()}" for tick in (tree.tick_once, tree.tick_exactly_once)] == ["RUNNING", "RUNNING"]
    assert tree.tick_once() == RUNNING == tree.status
