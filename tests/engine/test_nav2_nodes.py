"""Nav2's controls and decorators: pipelines, round robin, recovery, rates."""

from __future__ import annotations

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SKIPPED,
    SUCCESS,
    AlwaysFailure,
    AlwaysSuccess,
    ManualClock,
    PipelineSequence,
    RateController,
    RecoveryNode,
    RoundRobin,
    build_tree,
)
from tests.engine.planned_leaves import Again, Plan, ticks


def test_a_pipeline_goes_on_ticking_the_children_it_has_passed() -> None:
    a, b, c = Again("a", plan="RSRS"), Again("b", plan="RRS"), Again("c", plan="RS")
    tree = build_tree(PipelineSequence([a, b, c]))
    assert ticks(tree, 5) == [RUNNING, RUNNING, RUNNING, RUNNING, SUCCESS]
    assert (a.ticks, b.ticks, c.ticks) == (5, 4, 2)


def test_a_pipeline_waits_for_the_first_child_until_it_was_passed_once() -> None:
    a, b = Again("a", plan="RRS"), Again("b", plan="R")
    ticks(build_tree(PipelineSequence([a, b])), 4)
    assert (a.ticks, b.ticks) == (4, 2)


def test_a_pipeline_fails_with_any_child_and_halts_the_others() -> None:
    a, b = Again("a", plan="SSF"), Plan("b", plan="R")
    tree = build_tree(PipelineSequence([a, b]))
    assert ticks(tree, 3) == [RUNNING, RUNNING, FAILURE]
    assert b.halts == 1


def test_round_robin_goes_on_with_the_next_child() -> None:
    a, b, c = Plan("a", plan="S"), Plan("b", plan="FS"), Plan("c", plan="S")
    tree = build_tree(RoundRobin([a, b, c]))
    assert ticks(tree, 3) == [SUCCESS, SUCCESS, SUCCESS]
    assert (a.ticks, b.ticks, c.ticks) == (2, 1, 1)


def test_round_robin_fails_when_all_children_failed_in_turn() -> None:
    tree = build_tree(RoundRobin([AlwaysFailure(), AlwaysFailure()]))
    assert ticks(tree, 2) == [FAILURE, FAILURE]


def test_a_halted_round_robin_begins_with_the_first_child_and_forgets_which_have_failed() -> None:
    a, b = Again("a", plan="F"), Plan("b", plan="R")
    tree = build_tree(RoundRobin([a, b]))
    for begun in (1, 2, 3):
        assert tree.tick_exactly_once() == RUNNING
        assert (a.ticks, b.ticks) == (begun, begun)
        tree.halt()


def test_a_success_of_a_round_robin_forgets_the_failures_before_it() -> None:
    tree = build_tree(RoundRobin([AlwaysFailure("a"), Again("b", plan="S"), AlwaysFailure("c")]))
    assert ticks(tree, 3) == [SUCCESS, SUCCESS, SUCCESS]


def test_round_robin_without_wrap_around_fails_once_after_the_last_child_and_begins_anew() -> None:
    a, b = Plan("a", plan="S"), Plan("b", plan="S")
    tree = build_tree(RoundRobin([a, b], wrap_around=False))
    assert ticks(tree, 5) == [SUCCESS, SUCCESS, FAILURE, SUCCESS, SUCCESS]
    assert (a.ticks, b.ticks) == (2, 2)


def test_round_robin_skips_children_and_is_skipped_with_all_of_them() -> None:
    a, b = Plan("a", plan="K"), Plan("b", plan="S")
    assert ticks(build_tree(RoundRobin([a, b])), 2) == [SUCCESS, SUCCESS]
    assert (a.ticks, b.ticks) == (2, 2)
    assert build_tree(RoundRobin([Plan("c", plan="K"), Plan("d", plan="K")])).tick_exactly_once() == SKIPPED


def test_a_halted_round_robin_begins_with_the_first_child() -> None:
    a, b = Plan("a", plan="S"), Plan("b", plan="R")
    tree = build_tree(RoundRobin([a, b]))
    assert ticks(tree, 2) == [SUCCESS, RUNNING]
    tree.halt()
    assert ticks(tree, 1) == [SUCCESS]
    assert (a.ticks, b.ticks, b.halts) == (2, 1, 1)


def test_a_recovery_that_is_skipped_is_none_and_a_skipped_action_skips_the_node() -> None:
    assert build_tree(RecoveryNode([AlwaysFailure(), Plan("r", plan="K")])).tick_exactly_once() == FAILURE
    assert build_tree(RecoveryNode([Plan("a", plan="K"), AlwaysSuccess()])).tick_exactly_once() == SKIPPED


def test_a_halted_recovery_node_has_all_its_retries_again() -> None:
    act, recover = Plan("act", plan="F"), Plan("recover", plan="SRSR")
    tree = build_tree(RecoveryNode([act, recover], number_of_retries=2))
    assert ticks(tree, 1) == [RUNNING]
    tree.halt()
    assert recover.halts == 1
    assert ticks(tree, 1) == [RUNNING]
    assert recover.ticks == 4


def test_a_skipped_child_leaves_the_rate_controller_waiting_for_its_period() -> None:
    clock, child = ManualClock(), Again("child", plan="KS")
    tree = build_tree(RateController(child, hz=2.0), clock=clock)
    assert ticks(tree, 2) == [SKIPPED, RUNNING]
    clock.advance(0.5)
    assert ticks(tree, 1) == [SUCCESS]


def test_a_recovery_node_retries_after_each_recovery() -> None:
    act, recover = Plan("act", plan="FRFS"), Plan("recover", plan="RS")
    tree = build_tree(RecoveryNode([act, recover], number_of_retries=2))
    assert ticks(tree, 4) == [RUNNING, RUNNING, SUCCESS, SUCCESS]
    assert (act.ticks, recover.ticks) == (5, 3)


def test_a_recovery_node_fails_when_its_retries_are_used_up_or_the_recovery_fails() -> None:
    assert build_tree(RecoveryNode([AlwaysFailure(), AlwaysSuccess()])).tick_exactly_once() == FAILURE
    assert build_tree(RecoveryNode([AlwaysFailure(), AlwaysFailure()])).tick_exactly_once() == FAILURE


def test_a_rate_controller_in_a_pipeline_ticks_its_child_at_its_rate() -> None:
    clock, child = ManualClock(), Again("child", plan="S")
    tree = build_tree(PipelineSequence([RateController(child, hz=2.0), Plan("drive", plan="R")]), clock=clock)
    times = []
    for _ in range(12):
        before = child.ticks
        tree.tick_exactly_once()
        if child.ticks > before:
            times.append(round(clock.now(), 3))
        clock.advance(0.125)
    assert times == [0.0, 0.5, 1.0]
