"""The executor on simulated time: every way in which an execution ends, and what others may do meanwhile."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from py_trees import composites
from py_trees.behaviour import Behaviour
from py_trees.common import Status

from behaviours.failure import NodeFailure
from bestman_bt.engine import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    AlwaysSuccess,
    BlackboardError,
    Fallback,
    In,
    ManualClock,
    NodeRegistry,
    Sequence,
    StatefulAction,
    Tree,
    build_tree,
    load_tree,
)
from bestman_bt.runtime.executor import MAX_TASKS, Executor, PauseReason, TerminationReason
from bestman_bt.runtime.failure_lines import FailureLines, failure_codes
from hal.api import CommandRefusedError

HALTED: list[str] = []


class Work(StatefulAction):
    """Runs until its entry ``done`` in the tree is set; notes when it is halted."""

    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return self.tree.blackboard.get("done", RUNNING)

    def on_halted(self) -> None:
        HALTED.append(self.path)


class Break(StatefulAction):
    """Raises at its third tick."""

    def on_start(self) -> int:
        self.ticks = 1
        return RUNNING

    def on_running(self) -> int:
        self.ticks += 1
        if self.ticks == 3:
            raise ValueError("the gear is stripped")
        return RUNNING


class Exits(StatefulAction):
    """Ends the program, as a script does, in its method ``when``; its halts are noted."""

    when = In(str)

    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        if self.when == "on_running":
            sys.exit(0)
        return RUNNING

    def on_halted(self) -> None:
        HALTED.append(self.path)
        if self.when == "on_halted":
            sys.exit(0)


@pytest.fixture(autouse=True)
def nobody_halted_yet() -> None:
    HALTED.clear()


def tree_of(body: str, clock: ManualClock | None = None) -> Tree:
    registry = NodeRegistry()
    registry.register(Work)
    registry.register(Break)
    registry.register(Exits)
    text = f'<root BTCPP_format="4"><BehaviorTree ID="Main">{body}</BehaviorTree></root>'
    return load_tree(text, registry, clock=clock or ManualClock())


def executor_of(body: str, **options: object) -> Executor:
    tree = tree_of(body)
    return Executor(tree, tree.clock, **options)


def at_tick(number: int, act: Callable[[Executor], None], body: str = '<Work name="work"/>', **options) -> Executor:
    """An executor in whose ``number``-th tick something is done."""
    executor = executor_of(body, **options)

    def after_tick() -> None:
        if executor.ticks == number:
            act(executor)

    executor.after_tick = after_tick
    return executor


@pytest.mark.parametrize(("body", "status"), [("<AlwaysSuccess/>", "SUCCESS"), ("<AlwaysFailure/>", "FAILURE")])
def test_a_tree_that_ends_gives_its_status(body: str, status: str) -> None:
    execution = executor_of(body).run()
    assert (execution.ending, execution.tree_status, execution.ticks) == (TerminationReason.FINISHED, status, 1)
    assert execution.succeeded is (status == "SUCCESS")
    assert execution.why == ""


def test_ticks_are_a_period_apart_on_the_clock() -> None:
    executor = at_tick(11, lambda e: e.tree.blackboard.set("done", SUCCESS), period=0.1)
    execution = executor.run()
    assert execution.ticks == 12
    assert execution.sim_time_s == pytest.approx(1.1)


def test_the_time_limit_halts_the_tree_and_reports_it() -> None:
    execution = executor_of('<Work name="work"/>', time_limit=2.0).run()
    assert (execution.ending, execution.tree_status) == (TerminationReason.TIMEOUT, "IDLE")
    assert execution.why == "not done within 2 s"
    assert execution.sim_time_s == pytest.approx(2.0, abs=0.05)
    assert HALTED == ["work"]


def test_a_tree_that_retries_at_once_and_for_ever_still_ends_in_time_and_can_be_cancelled() -> None:
    body = '<RetryUntilSuccessful num_attempts="-1"><AlwaysFailure/></RetryUntilSuccessful>'
    assert executor_of(body, time_limit=0.2).run().ending is TerminationReason.TIMEOUT
    assert at_tick(50, lambda e: e.cancel(), body).run().ticks == 50


def test_only_wake_ups_in_a_row_at_one_moment_make_time_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bestman_bt.runtime.executor.MAX_WAKE_UPS", 3)
    executor = executor_of('<Work name="work"/>', period=0.1)

    def wake() -> None:
        if executor.ticks % 3:
            executor.tree.wake_up()
        if executor.ticks == 30:
            executor.cancel()

    executor.after_tick = wake
    executor.run()
    assert executor.clock.now() == pytest.approx(0.9), "after every third tick but the last"


def test_a_node_that_raises_ends_the_execution_with_an_error_and_halts_the_others() -> None:
    body = '<Parallel failure_count="2" success_count="2"><Work name="work"/><Break name="gear"/></Parallel>'
    execution = executor_of(body).run()
    assert (execution.ending, execution.tree_status) == (TerminationReason.ERROR, "IDLE")
    assert "node 'gear' [Break]" in execution.why
    assert "the gear is stripped" in execution.why
    assert HALTED == ["work"]


@pytest.mark.parametrize("above", ["Sequence", "Fallback", "ReactiveSequence", "Inverter", "Parallel"])
def test_a_node_that_ends_the_program_is_named_like_one_that_raises(
    above: str, caplog: pytest.LogCaptureFixture
) -> None:
    execution = executor_of(f'<{above} name="above"><Exits name="door" when="on_running"/></{above}>').run()
    assert (execution.ending, execution.why) == (TerminationReason.ERROR, "node 'door' [Exits]: SystemExit: 0")
    assert f"the tick went through above [{above}] > door [Exits]" in caplog.text


def test_a_node_that_cannot_be_halted_is_named_and_the_others_are_halted_once() -> None:
    nodes = '<Exits name="a" when=""/><Exits name="b" when="on_halted"/><Exits name="c" when=""/><Work name="work"/>'
    body = f'<Parallel success_count="4">{nodes}</Parallel>'
    execution = executor_of(body, time_limit=1.0).run()
    assert (execution.ending, execution.tree_status) == (TerminationReason.ERROR, "IDLE")
    assert execution.why == "node 'b' [Exits]: SystemExit: 0"
    assert HALTED == ["a", "b", "c", "work"]


def test_the_first_error_stays_the_reason_if_a_node_cannot_be_halted_either() -> None:
    body = '<Parallel success_count="2"><Exits name="door" when="on_halted"/><Break name="gear"/></Parallel>'
    assert "the gear is stripped" in executor_of(body).run().why
    assert len(HALTED) == 1
    cancelled = at_tick(2, lambda e: e.cancel("lunch"), '<Exits name="door" when="on_halted"/>').run()
    assert (cancelled.ending, cancelled.why) == (TerminationReason.CANCELLED, "lunch")


def test_a_robot_that_raises_between_ticks_is_an_error_too() -> None:
    class Breaking(ManualClock):
        def sleep(self, dt: float) -> None:
            raise CommandRefusedError("the cable is loose")

        def wait(self, dt: float, wake: threading.Event) -> None:
            self.sleep(dt)

    tree = tree_of('<Work name="work"/>', Breaking())
    execution = Executor(tree, tree.clock).run()
    assert (execution.ending, execution.why) == (TerminationReason.ERROR, "the cable is loose")
    assert HALTED == ["work"]


def test_cancelling_halts_the_tree_and_keeps_the_first_reason() -> None:
    def cancel(executor: Executor) -> None:
        executor.cancel("lunch")
        executor.cancel("supper")

    execution = at_tick(3, cancel).run()
    assert (execution.ending, execution.tree_status, execution.why) == (TerminationReason.CANCELLED, "IDLE", "lunch")
    assert execution.ticks == 3
    assert HALTED == ["work"]


@pytest.mark.parametrize("status", [SUCCESS, FAILURE])
def test_a_tree_that_ends_because_it_was_stopped_was_cancelled(status: int) -> None:
    """A stopped robot refuses commands, so skills fail in the tick that still goes on: that is no failure."""

    def stop(executor: Executor) -> None:
        executor.tree.blackboard.set("done", status)
        executor.after_tick = lambda: executor.cancel("stopped")

    execution = at_tick(3, stop).run()
    assert (execution.ending, execution.tree_status) == (TerminationReason.CANCELLED, "IDLE")


def test_an_execution_can_be_cancelled_from_another_thread() -> None:
    executor = executor_of('<Work name="work"/>', after_tick=lambda: time.sleep(0.002))
    threading.Timer(0.05, executor.cancel).start()
    execution = executor.run()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "cancelled on request")


def test_the_first_interrupt_cancels_between_ticks_and_the_handler_is_put_back() -> None:
    before = signal.getsignal(signal.SIGINT)
    executor = at_tick(3, lambda _: os.kill(os.getpid(), signal.SIGINT))
    execution = executor.run()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "interrupted from the keyboard")
    assert signal.getsignal(signal.SIGINT) is before
    assert HALTED == ["work"]


def test_a_termination_signal_cancels_too_and_both_handlers_are_put_back() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    execution = at_tick(3, lambda _: os.kill(os.getpid(), signal.SIGTERM)).run()
    assert (execution.ending, execution.why, execution.ticks) == (TerminationReason.CANCELLED, "terminated", 3)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == before
    assert HALTED == ["work"]


def test_what_was_cancelled_before_its_start_ticks_nothing() -> None:
    executor = executor_of('<Work name="work"/>')
    executor.cancel("too early")
    execution = executor.run()
    assert (execution.ending, execution.why, execution.ticks) == (TerminationReason.CANCELLED, "too early", 0)
    assert all(node.state == IDLE for node in executor.tree.nodes)


def test_a_node_that_breaks_because_it_was_stopped_was_cancelled() -> None:
    def cancel(executor: Executor) -> None:
        executor.cancel("stopped")
        raise CommandRefusedError("the robot is stopped")

    execution = at_tick(2, cancel).run()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "stopped")
    assert HALTED == ["work"]


def test_the_time_limit_counts_from_the_start_of_the_run_and_ends_at_its_tick() -> None:
    executor = executor_of('<Work name="work"/>', time_limit=0.5, period=0.125)
    executor.clock.sleep(100.0)
    execution = executor.run()
    assert (execution.ending, execution.ticks, execution.sim_time_s) == (TerminationReason.TIMEOUT, 5, 0.5)


def test_the_time_of_a_pause_does_not_count_for_the_time_limit() -> None:
    class Hardware:
        """Time passes in a pause."""

        def after_tick(self) -> None:
            if executor.ticks == 2:
                executor.pause()

        def held(self, hold: PauseReason | None) -> None:
            if hold is not None:
                executor.clock.sleep(100.0)
                executor.resume()

    executor = executor_of('<Work name="work"/>', time_limit=0.5, period=0.125)
    executor.watchers.append(Hardware())
    execution = executor.run()
    assert (execution.ending, execution.ticks, execution.sim_time_s) == (TerminationReason.TIMEOUT, 5, 100.5)
    again = executor.run()  # without a pause
    assert (again.ending, again.sim_time_s) == (TerminationReason.TIMEOUT, 0.5)


def test_watchers_are_told_of_each_pause_with_its_reason_and_of_its_end() -> None:
    class Watching:
        def __init__(self) -> None:
            self.told: list[object] = []

        def after_tick(self) -> None:
            self.told.append(executor.ticks)

        def held(self, hold: PauseReason | None) -> None:
            self.told.append(hold)
            if hold is not None:
                executor.step() if executor.ticks < 2 else executor.cancel()

    executor = executor_of('<Work name="work"/>')
    watching = Watching()
    executor.watchers.append(watching)
    executor.pause()
    executor.run()
    assert watching.told == [PauseReason(), None, 1, PauseReason(), None, 2, PauseReason(), None]


def test_what_is_asked_for_is_done_in_its_order_and_some_of_a_flood_waits_for_the_next_turn() -> None:
    done: list[int] = []
    executor = at_tick(1, lambda e: None)
    flood = [executor.between_ticks(lambda number=number: done.append(number)) for number in range(3 * MAX_TASKS)]
    before: list[int] = []
    executor.after_tick = lambda: before.append(len(done)) if executor.ticks < 5 else executor.cancel()
    executor.run()
    assert before[:3] == [MAX_TASKS, 2 * MAX_TASKS, 3 * MAX_TASKS]
    assert done == list(range(3 * MAX_TASKS))
    assert all(future.done() and not future.cancelled() for future in flood)


def interrupt(times: int) -> None:
    for _ in range(times):
        signal.raise_signal(signal.SIGINT)


def test_the_second_interrupt_does_not_wait_for_the_tick_and_still_halts_the_tree() -> None:
    def interrupt_twice(_: Executor) -> None:
        interrupt(2)
        pytest.fail("the tick went on")

    execution = at_tick(3, interrupt_twice).run()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "interrupted from the keyboard")
    assert HALTED == ["work"]


def test_more_interrupts_do_not_break_off_what_follows_a_cancelled_execution(monkeypatch: pytest.MonkeyPatch) -> None:
    executor = at_tick(3, lambda _: interrupt(1))
    monkeypatch.setattr(executor.tree, "shutdown", lambda: interrupt(1))
    with executor.interrupts():
        assert executor.run().ending is TerminationReason.CANCELLED
        interrupt(2)
        monkeypatch.setattr("bestman_bt.runtime.executor.WRAP_UP_TIME", 0.0)
        with pytest.raises(KeyboardInterrupt):
            interrupt(1)


def test_after_an_execution_that_nobody_cancelled_an_interrupt_is_an_interrupt() -> None:
    executor = executor_of("<AlwaysSuccess/>")
    with executor.interrupts():
        assert executor.run().succeeded
        with pytest.raises(KeyboardInterrupt):
            interrupt(1)


def test_an_interrupt_ends_a_paused_execution() -> None:
    executor = at_tick(3, lambda e: e.pause())
    threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGINT)).start()
    assert executor.run().ending is TerminationReason.CANCELLED


class InThread:
    """An execution in a thread of its own, with what another thread may do to it."""

    def __init__(self) -> None:
        self.executor = executor_of('<Work name="work"/>', after_tick=lambda: time.sleep(0.001))
        self.thread = threading.Thread(target=self.executor.run)

    def __enter__(self) -> Executor:
        self.executor.pause()
        self.thread.start()
        return self.executor

    def __exit__(self, *_: object) -> None:
        self.executor.cancel()
        self.thread.join(60.0)
        assert not self.thread.is_alive()


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end, "it never came true"
        time.sleep(0.005)


def test_while_paused_neither_ticks_nor_time_go_on_and_resume_goes_on() -> None:
    with InThread() as executor:
        time.sleep(0.15)
        assert (executor.paused, executor.ticks, executor.clock.now()) == (True, 0, 0.0)
        executor.resume()
        wait_until(lambda: executor.ticks > 3)
        assert not executor.paused


def test_a_step_is_one_tick() -> None:
    with InThread() as executor:
        for steps in (1, 2, 3):
            executor.step()
            wait_until(lambda steps=steps: executor.ticks == steps and executor.paused)
        time.sleep(0.1)
        assert executor.ticks == 3


def test_what_is_asked_for_is_done_between_ticks_also_while_paused() -> None:
    with InThread() as executor:
        executor.between_ticks(lambda: executor.tree.blackboard.set("speed", 3)).result(2.0)
        assert executor.ticks == 0
        assert executor.tree.blackboard.get("speed") == 3


def test_an_error_there_is_reported_to_its_caller_only() -> None:
    with InThread() as executor:
        executor.between_ticks(lambda: executor.tree.blackboard.set("speed", 3)).result(2.0)
        wrong = executor.between_ticks(lambda: executor.tree.blackboard.set("speed", "fast"))
        with pytest.raises(BlackboardError, match="speed"):
            wrong.result(2.0)
        executor.resume()
        wait_until(lambda: executor.ticks > 3)


def test_what_comes_too_late_is_refused() -> None:
    late: list = []
    executor = at_tick(1, lambda e: late.append(e.between_ticks(lambda: None)), "<AlwaysSuccess/>")
    executor.run()
    assert late[0].cancelled()


def test_after_the_end_nothing_in_the_tree_runs() -> None:
    executor = executor_of('<Work name="work"/>', time_limit=0.5)
    executor.run()
    assert all(node.state == IDLE for node in executor.tree.nodes)


class Device(Behaviour):
    """A native behaviour that fails, and writes down its life."""

    def setup(self, **kwargs: Any) -> None:
        HALTED.append("setup")

    def update(self) -> Status:
        self.feedback_message = "no answer from the scale"
        return Status.FAILURE

    def shutdown(self) -> None:
        HALTED.append("shutdown")
        raise OSError("port busy")


def test_native_behaviours_are_set_up_and_shut_down_whatever_the_end(caplog: pytest.LogCaptureFixture) -> None:
    tree = build_tree(Fallback([Device("scale"), AlwaysSuccess()]), clock=ManualClock())
    execution = Executor(tree, tree.clock).run()
    assert (execution.ending, execution.succeeded) == (TerminationReason.FINISHED, True)
    assert HALTED == ["setup", "shutdown"]
    assert "node scale " in caplog.text
    assert "port busy" in caplog.text


def test_a_setup_that_fails_ends_the_execution_and_reports_why() -> None:
    class Broken(Device):
        def setup(self, **kwargs: Any) -> None:
            raise OSError("no device at /dev/ttyUSB0")

    tree = build_tree(Sequence([Broken("scale")]), clock=ManualClock())
    execution = Executor(tree, tree.clock).run()
    assert execution.ending is TerminationReason.ERROR
    assert "node scale " in execution.why
    assert "no device at /dev/ttyUSB0" in execution.why
    assert execution.ticks == 0


def test_the_feedback_of_a_native_leaf_is_the_reason_of_its_failure() -> None:
    tree = build_tree(composites.Sequence("native", True, [Device("scale")]), clock=ManualClock())
    failed: list[int] = []
    tree.subscribe(lambda changes: failed.extend(code >> 3 for code in failure_codes(tree).intersection(changes.codes)))
    Executor(tree, tree.clock).run()
    where = f"scale (test_executor.py:{Device.update.__code__.co_firstlineno})"
    assert FailureLines().of(tree, failed) == [NodeFailure("scale", "", "no answer from the scale", where)]


def test_what_an_own_algorithm_raises_between_ticks_ends_the_execution_and_its_traceback_is_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def raises() -> None:
        raise IndexError("list index out of range")

    tree = build_tree(Work("work"))
    execution = Executor(tree, ManualClock(), after_tick=raises).run()
    assert (execution.ending, execution.why) == (TerminationReason.ERROR, "IndexError: list index out of range")
    assert tree.root.state == IDLE
    assert caplog.records[-1].exc_info is not None
