"""Breakpoints hold the execution within a tick, at the node; a forced result replaces one tick."""

from __future__ import annotations

import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import IDLE, RUNNING, SUCCESS, ManualClock, NodeRegistry, StatefulAction, load_tree
from bestman_bt.monitor.control_client import ControlError, request
from bestman_bt.records.events import RunEvent, from_line
from bestman_bt.runtime.breakpoints import BreakpointError, Breakpoints
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Execution, Executor, PauseReason, TerminationReason
from bestman_bt.runtime.telemetry import Telemetry
from tests.monitor.conftest import wait_until

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Repeat num_cycles="-1" name="again"><Fallback name="either">
    <Sequence name="both"><Script name="count" code="n += 1"/><Work name="work"/></Sequence>
    <AlwaysSuccess name="instead"/>
  </Fallback></Repeat>
</BehaviorTree></root>"""


class Work(StatefulAction):
    """Two ticks; tells what was done with it."""

    def on_start(self) -> int:
        self.context.append("start")
        return RUNNING

    def on_running(self) -> int:
        self.context.append("done")
        return SUCCESS

    def on_halted(self) -> None:
        self.context.append("halted")


class Debugged:
    """An execution in a thread, and the hand that controls it."""

    def __init__(self, folder: Path) -> None:
        registry = NodeRegistry()
        registry.register(Work)
        self.done: list[str] = []
        clock = ManualClock()
        self.tree = load_tree(TREE, registry, clock=clock, context=self.done)
        self.tree.blackboard.set("n", 0)
        self.executor = Executor(self.tree, clock, after_tick=lambda: time.sleep(0.001))
        run = RunEvent("debugged", "Main", "", "", 0, "", os.getpid(), time.time(), 20.0, "simulated")
        self.telemetry = Telemetry(self.executor, run)
        self.channel = ControlChannel(self.executor, lambda: None, self.telemetry)
        self.folder = folder
        self.execution: Execution | None = None

    def ask(self, what: str, **more: Any) -> dict[str, Any]:
        return request(self.folder / "control.sock", {"do": what, **more})

    def held_at(self, path: str | None) -> dict[str, Any]:
        """Wait until it holds at that node (None: between two ticks); the answer then."""
        wait_until(lambda: self._holds_at(path), f"it holds at {path}")
        return self.ask("status")

    def _holds_at(self, path: str | None) -> bool:
        held_at = self.ask("status")["held_at"]
        return held_at is not None and held_at.get("node") == path

    def goes_on_from(self, ticks: int) -> None:
        """Wait until it has ticked more often than it would if it held again."""
        wait_until(lambda: self.ask("status")["ticks"] > ticks + 3, "it goes on")

    def __enter__(self) -> Debugged:
        self.serving = self.channel.serving(self.folder)
        self.telemetry.__enter__()
        self.serving.__enter__()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()
        return self

    def _run(self) -> None:
        self.execution = self.executor.run()

    def __exit__(self, *_: object) -> None:
        self.executor.cancel()
        self.thread.join(60.0)
        self.serving.__exit__(None, None, None)
        self.telemetry.__exit__(None, None, None)

    def end(self) -> Execution:
        self.thread.join(60.0)
        assert self.execution is not None
        return self.execution


@pytest.fixture
def debugged(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Debugged]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))  # the path of a socket is short
    with Debugged(tmp_path) as debugged:
        debugged.ask("pause")
        yield debugged


def test_it_holds_before_a_node_begins_and_the_clock_stands_still(debugged: Debugged) -> None:
    told = debugged.ask("breakpoint", node="work", when="before")["breakpoints"]
    assert told == [{"node": 5, "path": "work", "when": "before", "condition": None, "once": False}]
    debugged.ask("resume")
    first = debugged.held_at("work")
    work, count = debugged.tree.node("work"), debugged.tree.node("count")
    assert (work.state, count.state) == (IDLE, SUCCESS)
    assert debugged.done[-1:] != ["start"]
    time.sleep(0.1)
    second = debugged.ask("status")
    assert (second["ticks"], second["time"]) == (first["ticks"], first["time"])
    debugged.ask("resume")
    debugged.held_at("work")
    assert debugged.done[-2:] == ["start", "done"]


def test_it_holds_after_a_node_has_its_result_not_while_it_runs(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node=5, when="after")
    debugged.ask("resume")
    debugged.held_at("work")
    assert debugged.done[-1] == "done"


def test_a_step_from_there_ends_the_tick_and_waits_again(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="count", when="after")
    debugged.ask("resume")
    ticks = debugged.held_at("count")["ticks"]
    debugged.ask("step")
    wait_until(lambda: debugged.ask("status")["ticks"] > ticks, "it ticks")
    answer = debugged.held_at(None)
    assert answer["ticks"] == ticks + 1
    assert debugged.tree.node("work").state == RUNNING


def test_a_condition_is_a_script_and_holds_once_when_it_becomes_true(debugged: Debugged) -> None:
    debugged.ask("set", key="n", value=0)
    debugged.ask("breakpoint", node="work", when="before", condition="n >= 5")
    debugged.ask("resume")
    debugged.held_at("work")
    assert debugged.tree.blackboard.get("n") == 5
    debugged.ask("resume")
    wait_until(lambda: debugged.tree.blackboard.get("n") > 6, "it goes on")
    assert not debugged.ask("status")["paused"]


def test_one_for_once_is_gone_when_it_was_hit(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="work", when="before", once=True)
    debugged.ask("resume")
    assert debugged.held_at("work")["breakpoints"] == []
    debugged.goes_on_from(debugged.ask("resume")["ticks"])
    assert debugged.tree.node("work").hooks is None


def test_a_cleared_one_does_not_hold(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="work", when="before")
    debugged.ask("breakpoint", node="work", when="after")
    assert len(debugged.ask("clear_breakpoint", node="work", when="before")["breakpoints"]) == 1
    assert debugged.ask("clear_breakpoint")["breakpoints"] == []
    debugged.goes_on_from(debugged.ask("resume")["ticks"])


def test_while_it_holds_entries_can_be_set_and_breakpoints_too(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="count", when="after")
    debugged.ask("resume")
    debugged.held_at("count")
    debugged.ask("set", key="n", value=1000)
    debugged.ask("breakpoint", node="work", when="before")
    debugged.ask("clear_breakpoint", node="count")
    debugged.ask("resume")
    debugged.held_at("work")
    assert debugged.tree.blackboard.get("n") == 1000


def test_a_held_execution_can_be_stopped_within_the_tick(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="work", when="before")
    debugged.ask("resume")
    debugged.held_at("work")
    done = list(debugged.done)
    debugged.ask("stop")
    execution = debugged.end()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "stopped through the control channel")
    assert [word for word in debugged.done[len(done) :] if word != "halted"] == []


def test_a_forced_result_replaces_one_tick_of_a_node_and_halts_it_first(debugged: Debugged) -> None:
    while debugged.tree.node("work").state != RUNNING:
        ticks = debugged.ask("status")["ticks"]
        debugged.ask("step")
        wait_until(lambda ticks=ticks: debugged.ask("status")["ticks"] > ticks, "it ticks")
    debugged.ask("force", node="work", result="FAILURE")
    debugged.ask("breakpoint", node="instead", when="after", once=True)
    debugged.ask("resume")
    debugged.held_at("instead")
    assert debugged.done[-1] == "halted"
    debugged.ask("resume")
    wait_until(lambda: debugged.done[-4:].count("done") == 2, "it goes on")
    assert debugged.tree.node("work").hooks is None


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"do": "breakpoint", "node": "nowhere", "when": "before"}, "no node 'nowhere'"),
        ({"do": "breakpoint", "node": 99, "when": "before"}, "from 1 to 6, got 99"),
        ({"do": "breakpoint", "node": 1, "when": "during"}, "'before' or 'after' a node, got 'during'"),
        ({"do": "breakpoint", "node": 1, "when": "before", "condition": "n >"}, "n >"),
        ({"do": "breakpoint", "node": 1, "when": "before", "condition": {"n": 1}}, "a condition should be a script"),
        ({"do": "force", "node": 1, "result": ["SUCCESS"]}, "SUCCESS or FAILURE"),
        ({"do": "force", "node": 1, "result": "RUNNING"}, "SUCCESS or FAILURE, got 'RUNNING'"),
        ({"do": "set", "key": "n", "value": 1, "scope": "cellar"}, "no SubTree 'cellar'"),
        ({"do": "subscribe", "topics": ["gossip"]}, "some of states, blackboard"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(debugged: Debugged, asked: dict[str, Any], words: str) -> None:
    with pytest.raises(ControlError) as error:
        request(debugged.folder / "control.sock", asked)
    assert words in str(error.value)


def test_a_condition_on_an_entry_that_is_not_there_does_not_hold(debugged: Debugged) -> None:
    debugged.ask("breakpoint", node="work", when="before", condition="not_yet > 3")
    debugged.goes_on_from(debugged.ask("resume")["ticks"])


def test_watchers_receive_the_node_of_a_pause_and_the_tick_of_each_step(debugged: Debugged) -> None:
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(str((debugged.folder / "control.sock").resolve()))
        connection.sendall(b'{"do": "subscribe", "topics": ["states"]}\n')
        lines = connection.makefile("rb")
        assert json.loads(lines.readline())["ok"]
        told = (from_line(line) for line in lines)
        ticks = debugged.ask("status")["ticks"]
        debugged.ask("step")
        events = [next(told)]
        while events[-1].event != "paused" or len([event for event in events if event.event == "resumed"]) < 1:
            events.append(next(told))
        assert [event.tick for event in events if event.event == "states"][-1] == ticks + 1
        debugged.ask("breakpoint", node="work", when="before")
        debugged.ask("resume")
        while (event := next(told)).event != "paused" or event.reason != "breakpoint":
            tick = event.tick if event.event == "states" else None
        assert (event.node, event.when, tick) == ("work", "before", debugged.ask("status")["ticks"] + 1)


class Scripted:
    """An execution without threads that goes on at once wherever it held. ``at_hold``: what is done there."""

    def __init__(self, body: str, ticks: int = 40) -> None:
        registry = NodeRegistry()
        registry.register(Work)
        self.done: list[str] = []
        xml = f'<root BTCPP_format="4" main_tree_to_execute="Main">{body}</root>'
        self.tree = load_tree(xml, registry, clock=ManualClock(), context=self.done)
        self.executor = Executor(self.tree, self.tree.clock, after_tick=self._count)
        self.executor.watchers.append(self)
        self.changes = 0
        self.breakpoints = Breakpoints(self.executor, self._changed)
        self.holds: list[tuple[str | None, str | None]] = []
        self.at_hold = lambda: None
        self.ticks = ticks

    def run(self) -> list[tuple[str | None, str | None]]:
        self.executor.run()
        return self.holds

    def held(self, hold: PauseReason | None) -> None:
        if hold is not None:
            self.holds.append((hold.node, hold.when))
            self.at_hold()
            self.executor.resume()

    def after_tick(self) -> None:
        pass

    def _count(self) -> None:
        if self.executor.ticks >= self.ticks:
            self.executor.cancel()

    def _changed(self) -> None:
        self.changes += 1


MAIN = """<BehaviorTree ID="Main"><Repeat num_cycles="-1" name="again"><Sequence name="both">
  <Script name="count" code="n += 1"/><Work name="work"/></Sequence></Repeat></BehaviorTree>"""


def counting(ticks: int = 40) -> Scripted:
    scripted = Scripted(MAIN, ticks)
    scripted.tree.blackboard.set("n", 0)
    return scripted


def test_a_condition_that_was_false_in_between_holds_again() -> None:
    scripted = counting()
    scripted.breakpoints.add("work", "before", "n >= 3")
    held_at = []

    def start_again() -> None:
        held_at.append(scripted.tree.blackboard.get("n"))
        scripted.tree.blackboard.set("n", 0)

    scripted.at_hold = start_again
    assert len(scripted.run()) >= 3
    assert set(held_at) == {3}


def test_a_breakpoint_in_the_place_of_another_is_the_only_one_there() -> None:
    scripted = counting()
    scripted.breakpoints.add("work", "before", "n == 2")
    scripted.breakpoints.add(4, "before", "n == 4", once=True)
    scripted.breakpoints.add("count", "after", "n == 3")
    assert [one["condition"] for one in scripted.breakpoints.documents()] == ["n == 4", "n == 3"]
    assert scripted.run() == [("count", "after"), ("work", "before")]
    assert scripted.changes == 4
    assert [one["path"] for one in scripted.breakpoints.documents()] == ["count"]


def test_those_of_one_moment_can_be_cleared_everywhere() -> None:
    scripted = counting(ticks=6)
    for node in ("count", "work"):
        for when in ("before", "after"):
            scripted.breakpoints.add(node, when)
    scripted.breakpoints.clear(when="after")
    assert [(one["path"], one["when"]) for one in scripted.breakpoints.documents()] == [
        ("count", "before"),
        ("work", "before"),
    ]
    assert set(scripted.run()) == {("count", "before"), ("work", "before")}
    scripted.breakpoints.clear("work")
    scripted.breakpoints.clear("count", "after")
    assert [one["path"] for one in scripted.breakpoints.documents()] == ["count"]
    scripted.breakpoints.clear()
    assert all(node.hooks is None for node in scripted.tree.nodes)


def test_a_condition_is_read_in_the_scope_of_its_node() -> None:
    inner = '<BehaviorTree ID="Inner"><Sequence><Script code="n := 7"/><Work name="work"/></Sequence></BehaviorTree>'
    outer = """<BehaviorTree ID="Main"><Repeat num_cycles="-1" name="again"><Sequence><Script code="n := 1"/>
        <SubTree ID="Inner" name="inside"/></Sequence></Repeat></BehaviorTree>"""
    scripted = Scripted(outer + inner, ticks=8)
    scripted.breakpoints.add("inside/work", "before", "n == 7", once=True)
    scripted.breakpoints.add("again", "before", "n == 7")
    assert scripted.run() == [("inside/work", "before")]


def test_a_forced_result_is_given_once_and_each_node_gets_its_own() -> None:
    scripted = counting(ticks=12)
    results: list[int] = []
    scripted.tree.node("work").add_post_tick(lambda node, status: results.append(status))
    scripted.breakpoints.force(4, "SUCCESS")
    scripted.breakpoints.force("count", "SUCCESS")
    scripted.run()
    assert results[:3] == [SUCCESS, RUNNING, SUCCESS]
    assert scripted.tree.blackboard.get("n") == scripted.done.count("start")  # of both, the first tick was replaced
    assert scripted.tree.node("count").hooks is None


def test_a_forced_result_outlives_the_breakpoints_of_its_node() -> None:
    scripted = counting(ticks=6)
    scripted.breakpoints.add("work", "before")
    scripted.breakpoints.force("work", "FAILURE")
    scripted.breakpoints.clear("work")
    assert scripted.run() == []
    assert (scripted.done, scripted.executor.ticks) == ([], 1)


def test_resuming_from_a_breakpoint_within_a_step_does_not_pause_after_it() -> None:
    scripted = counting(ticks=6)
    scripted.breakpoints.add("work", "before", once=True)
    scripted.executor.pause()

    def held(hold: PauseReason | None) -> None:
        if hold is not None:
            scripted.holds.append((hold.node, hold.when))
            scripted.executor.step() if hold.node is None else scripted.executor.resume()

    scripted.held = held
    assert scripted.run() == [(None, None), ("work", "before")]
    assert scripted.executor.ticks == 6


def test_a_forced_failure_is_one_though_the_node_would_succeed() -> None:
    scripted = counting(ticks=12)
    scripted.breakpoints.force("work", "SUCCESS")
    scripted.breakpoints.force("work", "FAILURE")
    scripted.run()
    assert scripted.done == []
    assert scripted.executor.ticks == 1


@pytest.mark.parametrize("node", [0, 5, True, "nowhere", None, 1.0])
def test_what_names_no_node_is_refused(node: Any) -> None:
    scripted = counting()
    for refused in (
        lambda: scripted.breakpoints.add(node, "before"),
        lambda: scripted.breakpoints.force(node, "SUCCESS"),
    ):
        with pytest.raises(BreakpointError, match="node"):
            refused()
    assert scripted.breakpoints.documents() == []
    for uid in (1, 4):
        scripted.breakpoints.add(uid, "after")
