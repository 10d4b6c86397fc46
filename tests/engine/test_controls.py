"""Controls the second time: skipped children counted anew, hooks put on later, states after an error."""

from __future__ import annotations

from typing import Any

import pytest

from bestman_bt.engine import (
    FAILURE,
    IDLE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    AlwaysFailure,
    AlwaysSuccess,
    AsyncFallback,
    AsyncSequence,
    Fallback,
    NodeError,
    Parallel,
    ParallelAll,
    PipelineSequence,
    PortInformation,
    ReactiveFallback,
    ReactiveSequence,
    RecoveryNode,
    RoundRobin,
    Sequence,
    SequenceWithMemory,
    SyncAction,
    TryCatch,
    build_tree,
)
from tests.engine.planned_leaves import Again, Plan, ticks


class Broken(SyncAction):
    """Returns a result once."""

    INPUT_PORTS = {"result": PortInformation(int)}
    broken = False

    def on_tick(self) -> int:
        if self.broken:
            raise OSError("no arm")
        self.broken = True
        return self.get_input("result")


def listened(root: Any, *, logged: bool) -> Any:
    tree = build_tree(root)
    if logged:
        tree.subscribe(lambda changes: None)
    return tree


@pytest.mark.parametrize("logged", [False, True])
@pytest.mark.parametrize(
    ("kind", "go", "stop", "result"),
    [
        (Sequence, "S", "F", SUCCESS),
        (AsyncSequence, "S", "F", SUCCESS),
        (ReactiveSequence, "S", "F", SUCCESS),
        (Fallback, "F", "S", FAILURE),
        (AsyncFallback, "F", "S", FAILURE),
        (ReactiveFallback, "F", "S", FAILURE),
    ],
)
def test_skipped_children_are_counted_anew_each_time_and_over_the_ticks_of_one_time(
    kind: Any, go: str, stop: str, result: int, logged: bool
) -> None:
    tree = listened(kind([Again("a", plan=f"K{go}KK"), Again("b", plan=f"{stop}KKRK")]), logged=logged)
    last = [tree.tick_once() for _ in range(2)][1]
    assert last == result, "one of two was skipped, after a time that ended early"
    assert tree.tick_once() == SKIPPED
    assert ticks(tree, 1) == [RUNNING]
    tree.halt()
    tree = listened(kind([Again("a", plan="K"), Again("b", plan="RK")]), logged=logged)
    assert ticks(tree, 2) == [RUNNING, SKIPPED]


@pytest.mark.parametrize(("kind", "go"), [(AsyncSequence, SUCCESS), (AsyncFallback, FAILURE)])
def test_a_control_that_yields_does_so_between_children_that_were_done_in_one_tick(kind: Any, go: int) -> None:
    letter = "S" if go == SUCCESS else "F"
    children = [Again("a", plan=letter), Plan("b", plan=f"R{letter}"), Again("c", plan="K"), Again("d", plan=letter)]
    assert ticks(build_tree(kind(children)), 3) == [RUNNING, RUNNING, go]


def test_a_sequence_with_memory_goes_on_with_the_child_that_failed_even_after_a_halt() -> None:
    a, b, c = Again("a", plan="S"), Again("b", plan="FRS"), Again("c", plan="FS")
    tree = build_tree(SequenceWithMemory([a, b, c]))
    assert [tree.tick_once() for _ in range(2)] == [FAILURE, RUNNING]
    tree.halt()
    assert [tree.tick_once() for _ in range(3)] == [FAILURE, SUCCESS, SUCCESS]
    assert (a.ticks, b.ticks, c.ticks) == (2, 4, 3)


@pytest.mark.parametrize("logged", [False, True])
@pytest.mark.parametrize(
    "kind",
    [
        Sequence,
        AsyncSequence,
        SequenceWithMemory,
        Fallback,
        ReactiveSequence,
        ReactiveFallback,
        Parallel,
        ParallelAll,
        PipelineSequence,
        RoundRobin,
        TryCatch,
        RecoveryNode,
    ],
)
def test_hooks_that_are_put_on_children_later_are_met_and_leave_no_trace(kind: Any, logged: bool) -> None:
    """As breakpoints and forced results are: on a tree that has ticked already."""
    inner = Plan("inner", plan="R")
    tree = listened(kind([inner, AlwaysSuccess()]), logged=logged)
    assert ticks(tree, 1) == [RUNNING]
    met: list[str] = []

    def hook(node: Any) -> None:
        met.append(node.name)

    def once(node: Any) -> None:
        met.append("once")
        inner.remove_hook(once, rebind=False)

    inner.add_pre_tick(once)
    inner.add_pre_tick(hook)
    assert ticks(tree, 1) == [RUNNING]
    assert (met, inner.ticks) == (["once", "inner"], 2)
    inner.remove_hook(hook)
    inner.add_pre_tick(lambda node: FAILURE)
    before = inner.ticks
    result = ticks(tree, 1)[0]
    assert inner.ticks == before
    assert met == ["once", "inner"]
    succeeds = {Fallback, ReactiveFallback, RoundRobin}
    expected = SUCCESS if kind in succeeds else FAILURE
    assert result == expected


@pytest.mark.parametrize("logged", [False, True])
@pytest.mark.parametrize(
    ("kind", "letter", "state"), [(ReactiveSequence, "S", SUCCESS), (ReactiveFallback, "F", FAILURE)]
)
def test_after_an_error_the_children_before_it_show_what_they_returned(
    kind: Any, letter: str, state: int, logged: bool
) -> None:
    first, skipped = Again("first", plan=letter), Again("skipped", plan=f"{letter}KK")
    last = Again("last", plan=letter)
    tree = listened(kind([first, skipped, Broken("broken", result=state), last]), logged=logged)
    assert ticks(tree, 1) == [state]
    for _ in range(2):
        with pytest.raises(NodeError, match="broken.*no arm"):
            tree.tick_exactly_once()
        assert [node.state for node in (first, skipped, last)] == [state, IDLE, IDLE]
    assert (first.ticks, last.ticks) == (3, 1)


def test_what_an_earlier_child_of_a_pipeline_runs_is_halted_as_the_pipeline_succeeds() -> None:
    first, second = Again("first", plan="SR"), Again("second", plan="RS")
    assert ticks(build_tree(PipelineSequence([first, second])), 2) == [RUNNING, SUCCESS]
    assert (first.state, second.state, first.halts) == (IDLE, IDLE, 1)


def test_a_recovery_that_fails_ends_the_node_though_the_action_might_have_succeeded() -> None:
    act = Plan("act", plan="FS")
    assert build_tree(RecoveryNode([act, AlwaysFailure()], number_of_retries=3)).tick_exactly_once() == FAILURE
    assert act.ticks == 1


@pytest.mark.parametrize(
    ("plans", "ports", "results"),
    [
        # the first against the third, and the second time
        (("S", "R", "S"), {"success_count": 2}, [SUCCESS, SUCCESS]),
        (("F", "R", "F"), {"success_count": 1, "failure_count": 2}, [FAILURE, FAILURE]),
        (("R", "S", "RF"), {"success_count": 2, "failure_count": 2}, [RUNNING, RUNNING]),
        (("K", "S", "S"), {}, [SUCCESS, SUCCESS]),
        (("K", "S", "R"), {"success_count": 3}, [RUNNING, RUNNING]),
        (("K", "K", "K"), {"success_count": 3}, [SKIPPED, SKIPPED]),
        (("R", "F", "F"), {"success_count": 1, "failure_count": -1}, [RUNNING, RUNNING]),
        (("R", "F", "F"), {"success_count": 1, "failure_count": -2}, [FAILURE, FAILURE]),
        (("R", "S", "S"), {"success_count": -2}, [SUCCESS, SUCCESS]),
    ],
)
def test_a_parallel_counts_all_its_children(plans: Any, ports: Any, results: list[int]) -> None:
    tree = build_tree(Parallel([Again(str(i), plan=plan) for i, plan in enumerate(plans)], **ports))
    assert ticks(tree, 2) == results


def test_a_parallel_ticks_no_child_that_is_done_until_it_begins_anew() -> None:
    done, other = Again("done", plan="S"), Again("other", plan="RRSRS")
    tree = build_tree(Parallel([done, other]))
    assert ticks(tree, 5) == [RUNNING, RUNNING, SUCCESS, RUNNING, SUCCESS]
    assert (done.ticks, other.ticks) == (2, 5)


@pytest.mark.parametrize(("limit", "result"), [(1, FAILURE), (2, FAILURE), (3, SUCCESS), (-1, SUCCESS), (-2, FAILURE)])
def test_parallel_all_waits_for_all_and_fails_from_so_many_failures_on(limit: int, result: int) -> None:
    plans = ("F", "RS", "RRF")
    tree = build_tree(ParallelAll([Plan(str(i), plan=plan) for i, plan in enumerate(plans)], max_failures=limit))
    assert ticks(tree, 3) == [RUNNING, RUNNING, result]
    assert tree.tick_exactly_once() == result, "leaves repeat their last letter"


def test_a_clean_up_that_is_halted_is_not_begun_once_more() -> None:
    clean_up = Plan("clean up", plan="R")
    tree = build_tree(TryCatch([AlwaysFailure(), clean_up], catch_on_halt=True))
    assert ticks(tree, 1) == [RUNNING]
    tree.halt()
    assert (clean_up.ticks, clean_up.halts) == (1, 1)
