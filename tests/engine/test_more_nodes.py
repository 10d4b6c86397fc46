"""Nodes beyond the recorded cases: ForEach, queues, ManualSelector, threads, coroutines, functions, timing."""

from __future__ import annotations

import io
import threading
import time
from collections import deque
from typing import Any

import pytest

from bestman_bt.engine import (
    FAILURE,
    RUNNING,
    SUCCESS,
    AlwaysFailure,
    AlwaysSuccess,
    ConsumeQueue,
    Context,
    CoroutineAction,
    Delay,
    Fallback,
    ForceSuccess,
    ForEach,
    FunctionLeafError,
    KeepRunningUntilFailure,
    LoopInt,
    ManualClock,
    ManualSelector,
    NodeError,
    NodeRegistry,
    Output,
    PopFromQueue,
    PortInformation,
    Precondition,
    QueueSize,
    Repeat,
    RetryUntilSuccessful,
    Script,
    ScriptCondition,
    Sequence,
    SetBlackboard,
    Sleep,
    SyncAction,
    ThreadedAction,
    Timeout,
    TreeLoadError,
    WasEntryUpdated,
    action,
    build_tree,
    condition,
    load_tree,
)
from tests.engine.planned_leaves import Plan, ticks


def test_a_default_that_names_an_entry_is_read_from_it_and_is_nothing_while_that_is_empty() -> None:
    class Watch(SyncAction):
        INPUT_PORTS = {"goal": PortInformation(object, required=False, default_value="{goal}")}

        def on_tick(self) -> int:
            self.seen = self.get_input("goal")
            return SUCCESS

    watch = Watch()
    tree = build_tree(watch)
    tree.tick_exactly_once()
    assert watch.seen is None
    tree.blackboard.set("goal", 3)
    tree.tick_exactly_once()
    assert watch.seen == 3


def test_for_each_runs_its_child_for_every_item() -> None:
    seen: list[Any] = []

    class Note(SyncAction):
        INPUT_PORTS = {"item": PortInformation(Any), "index": PortInformation(int)}

        def on_tick(self) -> int:
            seen.append((self.get_input("index"), self.get_input("item")))
            return SUCCESS

    tree = build_tree(ForEach(Note(item="{it}", index="{i}"), items="{poses}", item="{it}", index="{i}"))
    tree.blackboard.set("poses", ["a", "b", "c"])
    assert tree.tick_once() == SUCCESS
    assert seen == [(0, "a"), (1, "b"), (2, "c")]


def test_for_each_goes_over_the_items_that_were_there_when_it_started() -> None:
    found = ["a"]

    @action
    def look(item: Any) -> bool:
        found.append(f"behind {item}")
        return len(found) < 9

    tree = build_tree(ForEach(look(item="{it}"), items="{list}", item="{it}"))
    tree.blackboard.set("list", found)
    assert tree.tick_once() == SUCCESS
    assert found == ["a", "behind a"]


def test_for_each_ends_at_the_first_failure_and_succeeds_without_items() -> None:
    tree = build_tree(ForEach(ScriptCondition(code="it != 'b'"), items="{list}", item="{it}", index="{i}"))
    tree.blackboard.set("list", ["a", "b", "c"])
    assert tree.tick_once() == FAILURE
    assert tree.blackboard["i"] == 1
    tree.blackboard.set("list", [])
    assert tree.tick_once() == SUCCESS


def test_queues_are_emptied_in_place_by_loops_and_queue_nodes() -> None:
    tree = build_tree(
        Sequence(
            [
                QueueSize(queue="{q}", size="{size}"),
                PopFromQueue(queue="{q}", popped_item="{first}"),
                ConsumeQueue(ScriptCondition(code="now < 9"), queue="{q}", popped_item="{now}"),
            ]
        )
    )
    queue = deque([1, 2, 3])
    tree.blackboard.set("q", queue)
    assert tree.tick_exactly_once() == SUCCESS
    assert (tree.blackboard["size"], tree.blackboard["first"], tree.blackboard["now"], list(queue)) == (3, 1, 3, [])
    assert tree.tick_exactly_once() == FAILURE


@pytest.mark.parametrize(("result", "left"), [(SUCCESS, []), (FAILURE, [2])])
def test_a_queue_ends_with_an_item_that_ran_for_several_ticks_and_failed(result: int, left: list[int]) -> None:
    clock = ManualClock()
    wait = Sequence([Sleep(msec=100), ScriptCondition(code=f"now != 1 || {result} == 2")])
    tree = build_tree(ConsumeQueue(wait, queue="{q}", popped_item="{now}"), clock=clock)
    queue = deque([1, 2])
    tree.blackboard.set("q", queue)
    statuses = []
    while (status := tree.tick_exactly_once()) == RUNNING:
        statuses.append(status)
        clock.advance(0.1)
    assert (status, list(queue)) == (result, left)


def test_a_loop_reads_a_list_once_and_a_deque_at_every_item() -> None:
    tree = build_tree(LoopInt(AlwaysSuccess(), queue="{q}", value="{v}"))
    tree.blackboard.set("q", [4, 5])
    assert ticks(tree, 3) == [RUNNING, RUNNING, SUCCESS]
    assert (tree.blackboard["v"], tree.blackboard["q"]) == (5, [4, 5])
    tree.blackboard.unset("q")
    tree.blackboard.set("q", deque([6]))
    assert ticks(tree, 2) == [RUNNING, SUCCESS]
    assert list(tree.blackboard["q"]) == []


def test_a_loop_over_something_else_is_an_error() -> None:
    tree = build_tree(LoopInt(AlwaysSuccess(), queue="{q}", value="{v}"))
    tree.blackboard.set("q", 3)
    with pytest.raises(NodeError, match="expected a list of items but got 3"):
        tree.tick_exactly_once()
    with pytest.raises(TreeLoadError, match="'x' is not an int"):
        build_tree(LoopInt(AlwaysSuccess(), queue="1;x"))


def test_an_entry_that_was_set_counts_as_updated_once() -> None:
    tree = build_tree(Sequence([WasEntryUpdated(entry="{e}"), SetBlackboard(value="{e}", output_key="copy")]))
    assert tree.tick_exactly_once() == FAILURE
    tree.blackboard.set("e", 3.5)
    assert ticks(tree, 2) == [SUCCESS, FAILURE]
    assert tree.blackboard["copy"] == 3.5


@pytest.mark.parametrize(("answers", "expected"), [("2\n", FAILURE), ("s\n", SUCCESS), ("x\n9\n1\n", SUCCESS)])
def test_a_manual_selector_does_what_is_answered(answers: str, expected: int, monkeypatch: pytest.MonkeyPatch) -> None:
    questions = io.StringIO()
    monkeypatch.setattr(ManualSelector, "QUESTIONS", questions)
    monkeypatch.setattr(ManualSelector, "ANSWERS", io.StringIO(answers))
    tree = build_tree(ManualSelector("choose", [AlwaysSuccess("yes"), AlwaysFailure("no")]))
    assert tree.tick_exactly_once() == expected
    assert "choose: which child (1 yes, 2 no)" in questions.getvalue()


def test_a_manual_selector_repeats_its_last_choice_and_needs_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ManualSelector, "QUESTIONS", io.StringIO())
    monkeypatch.setattr(ManualSelector, "ANSWERS", io.StringIO("2\n"))
    tree = build_tree(ManualSelector([AlwaysSuccess(), AlwaysFailure()], repeat_last_selection=True))
    assert ticks(tree, 2) == [FAILURE, FAILURE]
    other = build_tree(ManualSelector([AlwaysSuccess(), AlwaysFailure()]))
    with pytest.raises(NodeError, match="cannot ask"):
        other.tick_exactly_once()


def test_a_manual_selector_halts_the_child_that_runs_when_another_is_chosen_or_it_is_halted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ManualSelector, "QUESTIONS", io.StringIO())
    monkeypatch.setattr(ManualSelector, "ANSWERS", io.StringIO("1\n1\n2\nr\nf\n1\n3\n"))
    first, second, done = Plan("first", plan="R"), Plan("second", plan="R"), Plan("done", plan="S")
    tree = build_tree(ManualSelector([first, second, done]))
    assert ticks(tree, 3) == [RUNNING, RUNNING, RUNNING]
    assert (first.ticks, first.halts, second.ticks, second.halts) == (2, 1, 1, 0)
    assert ticks(tree, 2) == [RUNNING, FAILURE]
    assert second.halts == 1
    assert ticks(tree, 1) == [RUNNING]
    tree.halt()
    assert (first.ticks, first.halts) == (3, 2)
    assert ticks(tree, 1) == [SUCCESS]
    assert (first.halts, second.halts, done.ticks) == (2, 1, 1)


@pytest.mark.parametrize(("waited", "result"), [(0.2499, RUNNING), (0.25, FAILURE)])
def test_a_timeout_ends_at_its_time_and_begins_anew(waited: float, result: int) -> None:
    clock, slow = ManualClock(), Plan("slow", plan="R")
    tree = build_tree(KeepRunningUntilFailure(ForceSuccess(Timeout(slow, msec=250))), clock=clock)
    inner = tree.nodes[2]
    ticks(tree, 1)
    clock.advance(waited)
    ticks(tree, 1)
    assert slow.halts == (result == FAILURE)
    if result == FAILURE:
        assert inner.last_result == FAILURE
        assert inner.feedback_message == "timed out after 0.25 s"
        ticks(tree, 1)
        clock.advance(0.24)
        ticks(tree, 1)
        assert slow.halts == 1


def test_a_timeout_of_nothing_is_none_and_a_child_that_ends_in_time_starts_it_anew() -> None:
    clock, slow = ManualClock(), Plan("slow", plan="RRS")
    tree = build_tree(Timeout(slow, msec=0), clock=clock)
    for expected in (RUNNING, RUNNING, SUCCESS):
        assert ticks(tree, 1) == [expected]
        clock.advance(100.0)
    clock, again = ManualClock(), Plan("again", plan="RSRR")
    tree = build_tree(Timeout(again, msec=250), clock=clock)
    for expected in (RUNNING, SUCCESS, RUNNING, RUNNING):
        assert ticks(tree, 1) == [expected]
        clock.advance(0.2)
    assert ticks(tree, 1) == [FAILURE]


def test_a_delay_waits_before_each_start_of_its_child() -> None:
    clock, child = ManualClock(), Plan("child", plan="SRRS")
    tree = build_tree(Delay(child, delay_msec=250), clock=clock)
    results = []
    for _ in range(8):
        results.append((tree.tick_exactly_once(), child.ticks))
        clock.advance(0.125)
    assert results == [(RUNNING, 0), (RUNNING, 0), (SUCCESS, 1)] + [(RUNNING, 1)] * 2 + [
        (RUNNING, 2),
        (RUNNING, 3),
        (SUCCESS, 4),
    ]
    assert tree.tick_exactly_once() == RUNNING
    tree.halt()
    clock.advance(5.0)
    assert (tree.tick_exactly_once(), child.ticks) == (RUNNING, 4)


class Count(ThreadedAction):
    """Counts until it is asked to stop."""

    def prepare(self) -> int:
        return int(self.context)

    def on_work(self, inputs: int) -> int:
        self.worker = threading.get_ident()
        for _ in range(inputs):
            if self.halt_requested:
                return FAILURE
            time.sleep(0.001)
        return SUCCESS


def test_a_threaded_action_works_off_the_tick_thread_and_wakes_the_loop() -> None:
    tree = build_tree(Count(), context=3)
    start = time.monotonic()
    assert tree.tick_while_running(period=30.0) == SUCCESS
    assert time.monotonic() - start < 10.0
    assert tree.root.worker != threading.get_ident()


def test_a_halted_threaded_action_leaves_no_thread_behind_and_works_when_it_is_started_again() -> None:
    before = threading.active_count()
    tree = build_tree(Count(), context=100_000)
    assert tree.tick_exactly_once() == RUNNING
    tree.halt()
    assert threading.active_count() == before
    tree.context = 3
    assert tree.tick_while_running(period=30.0) == SUCCESS


def test_what_a_thread_raises_is_raised_by_the_tick() -> None:
    class Broken(ThreadedAction):
        def on_work(self, inputs: Any) -> int:
            raise OSError("no arm")

    with pytest.raises(NodeError, match=r"\[Broken\]: OSError: no arm"):
        build_tree(Broken()).tick_while_running(period=5.0)


def test_a_threaded_action_that_has_failed_once_may_succeed_the_next_time() -> None:
    class Flaky(ThreadedAction):
        tries = 0

        def on_work(self, inputs: Any) -> int:
            Flaky.tries += 1
            if Flaky.tries == 1:
                raise OSError("no arm")
            return SUCCESS

    tree = build_tree(Flaky())
    with pytest.raises(NodeError, match="no arm"):
        tree.tick_while_running(period=5.0)
    tree.halt()
    assert tree.tick_while_running(period=5.0) == SUCCESS


def test_a_precondition_whose_script_is_an_entry_asks_the_script_that_stands_there_now() -> None:
    tree = build_tree(Precondition(AlwaysSuccess(), if_="{allowed}"))
    tree.blackboard.set("allowed", "1 == 1")
    assert tree.tick_exactly_once() == SUCCESS
    tree.blackboard.set("allowed", "1 == 2")
    assert tree.tick_exactly_once() == FAILURE


def test_a_coroutine_pauses_between_ticks_and_cleans_up_on_halt() -> None:
    class Wave(CoroutineAction):
        async def run_async(self) -> int:
            self.calls = ["begin"]
            try:
                await self.next_tick()
                self.calls.append("second")
                await self.sleep(0.5)
                self.calls.append("slept")
                await self.until(lambda: bool(self.board.get("go")))
            finally:
                self.calls.append("clean")
            return SUCCESS

    clock = ManualClock()
    tree = build_tree(Wave(), clock=clock)
    tree.blackboard.set("go", True)
    assert tree.tick_while_running(period=0.2) == SUCCESS
    assert tree.root.calls == ["begin", "second", "slept", "clean"]
    assert clock.now() == pytest.approx(0.8)
    tree.tick_exactly_once()
    tree.halt()
    assert tree.root.calls == ["begin", "clean"]


def test_a_coroutine_that_returns_no_status_is_an_error() -> None:
    class Nothing(CoroutineAction):
        async def run_async(self) -> int:
            return None

    with pytest.raises(NodeError, match=r"run_async\(\) returned None"):
        build_tree(Nothing()).tick_exactly_once()


@action
def add_numbers(a: int, b: int = 1, *, total: Output[int], world: Context) -> bool:
    """Add two numbers."""
    world.append((a, b))
    total.set(a + b)
    return True


@condition(name="IsNear")
def near(distance: int, limit: float = 0.5) -> bool:
    return distance < limit


def test_functions_become_leaves_with_ports_from_their_signatures() -> None:
    registry = NodeRegistry()
    registry.register(add_numbers)
    registry.register(near)
    info = registry.info("AddNumbers")
    assert (info.kind, registry.info("IsNear").kind, info.description) == ("Action", "Condition", "Add two numbers.")
    assert {p.name: (p.direction, p.data_type, p.required) for p in info.ports.values()} == {
        "a": ("input", int, True),
        "b": ("input", int, False),
        "total": ("output", int, False),
    }
    calls: list[Any] = []
    text = (
        '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence><AddNumbers a="4" total="{t}"/>'
        '<IsNear distance="{t}" limit="9"/><IsNear distance="{t}"/></Sequence></BehaviorTree></root>'
    )
    tree = load_tree(text, registry, context=calls)
    assert tree.tick_exactly_once() == FAILURE
    assert (tree.blackboard["t"], calls) == (5, [(4, 1)])


def test_a_function_whose_parameters_are_no_ports_is_refused() -> None:
    with pytest.raises(FunctionLeafError, match="'rest' cannot become a port"):

        @action
        def wrong(*rest: int) -> bool:
            return True


def test_a_function_that_returns_something_else_is_an_error() -> None:
    @action
    def odd() -> str:
        return "done"

    with pytest.raises(NodeError, match="its function returned 'done'"):
        build_tree(odd()).tick_exactly_once()


def test_timeout_and_delay_read_the_clock_at_the_tick() -> None:
    clock = ManualClock()
    slow = Plan("slow", plan="R")
    tree = build_tree(Fallback([Timeout(Delay(slow, delay_msec=100), msec=250), AlwaysSuccess()]), clock=clock)
    results = []
    for _ in range(4):
        results.append(tree.tick_exactly_once())
        clock.advance(0.1)
    assert results == [RUNNING, RUNNING, RUNNING, SUCCESS]
    assert (slow.ticks, slow.halts) == (2, 1)


def test_a_timeout_that_is_started_again_has_all_its_time_again() -> None:
    clock, slow = ManualClock(), Plan("slow", plan="R")
    tree = build_tree(Timeout(slow, msec=250), clock=clock)
    assert ticks(tree, 1) == [RUNNING]
    clock.advance(0.2)
    tree.halt()
    clock.advance(0.2)
    assert ticks(tree, 1) == [RUNNING]
    clock.advance(0.24)
    assert ticks(tree, 1) == [RUNNING]
    clock.advance(0.01)
    assert ticks(tree, 1) == [FAILURE]
    assert (slow.ticks, slow.halts) == (3, 2)


def test_attempts_are_read_anew_after_each_failure_and_cycles_only_when_the_node_is_ticked() -> None:
    fails = Sequence([Script(code="left -= 1"), AlwaysFailure()])
    tree = build_tree(RetryUntilSuccessful(fails, num_attempts="{left}"))
    tree.blackboard.set("left", 2)
    assert ticks(tree, 1) == [FAILURE]
    tree = build_tree(Repeat(Script(code="left += 1"), num_cycles="{left}"))
    tree.blackboard.set("left", 1)
    assert ticks(tree, 2) == [SUCCESS, RUNNING]


def test_a_loop_woken_by_a_thread_that_is_not_quite_gone_sees_its_result() -> None:
    class Lingering(ThreadedAction):
        def on_work(self, inputs: Any) -> int:
            return SUCCESS

        def wake_up(self) -> None:
            super().wake_up()
            time.sleep(0.2)  # the thread is still alive when the loop looks

    start = time.monotonic()
    assert build_tree(Lingering()).tick_while_running(period=30.0) == SUCCESS
    assert time.monotonic() - start < 10.0


def test_a_thread_that_exits_the_interpreter_is_reported_as_such() -> None:
    class Exits(ThreadedAction):
        def on_work(self, inputs: Any) -> int:
            raise SystemExit(3)

    with pytest.raises(NodeError, match=r"\[Exits\]: .*its on_work\(\) ended with SystemExit\(3\)"):
        build_tree(Exits()).tick_while_running(period=0.001)


def test_a_coroutine_that_awaits_while_it_is_halted_is_named() -> None:
    class Stubborn(CoroutineAction):
        async def run_async(self) -> int:
            try:
                await self.next_tick()
            finally:
                await self.next_tick()
            return SUCCESS

    tree = build_tree(Stubborn())
    tree.tick_exactly_once()
    with pytest.raises(NodeError, match=r"\[Stubborn\]: its run_async\(\) failed while it was halted"):
        tree.halt()
