"""What an execution leaves in its run folder, also where it ends without warning."""

from __future__ import annotations

import json
import logging
import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from behaviours.failure import NodeFailure
from bestman_bt.engine import (
    FAILURE,
    IDLE,
    RUNNING,
    SUCCESS,
    ManualClock,
    NodeRegistry,
    StatefulAction,
    Tree,
    load_tree,
)
from bestman_bt.engine.logs.btlog import read_btlog
from bestman_bt.engine.reloading import watched
from bestman_bt.monitor.event_stream import EventStream
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.events import (
    BlackboardEvent,
    DroppedEvent,
    EndEvent,
    Event,
    RunEvent,
    StatesEvent,
    TreeEvent,
    from_line,
)
from bestman_bt.records.reader import read_events, read_log
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.telemetry import Telemetry

TREE = """<root BTCPP_format="4" main_tree_to_execute="Main">
<BehaviorTree ID="Main"><Fallback name="try">
  <Grasp name="grasp"/>
  <SubTree ID="Look" name="look" far="true"/>
  <ForceFailure name="no"><AlwaysSuccess name="fine"/></ForceFailure>
</Fallback></BehaviorTree>
<BehaviorTree ID="Look"><Sequence>
  <Script name="note" code="seen := 3"/><AlwaysFailure name="gone"/>
</Sequence></BehaviorTree></root>"""
INNER = """<root BTCPP_format="4"><BehaviorTree ID="Plan"><Sequence>
  <Sleep msec="100" name="wait"/><AlwaysFailure name="stuck"/></Sequence></BehaviorTree></root>"""


class Grasp(StatefulAction):
    """Runs a tree of its own for a while, then fails and says why."""

    _inner: Tree

    def on_start(self) -> int:
        self._inner = load_tree(INNER, clock=self.clock)
        self.owner.announce_inner(self._inner, self)
        return self.on_running()

    def on_running(self) -> int:
        self.feedback_message = f"at {self.clock.now():.2f}"
        if self._inner.tick_once() == RUNNING:
            return RUNNING
        self.feedback_message = "the <cup> slipped"
        self.context.append(NodeFailure(self.path, "slipped", "the <cup> slipped", stamp=self.clock.now()))
        return FAILURE


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that has failed."""
    folder = tmp_path_factory.mktemp("run")
    registry = NodeRegistry()
    registry.register(Grasp)
    told: list[NodeFailure] = []
    clock = ManualClock(100.0)
    executor = Executor(load_tree(TREE, registry, clock=clock, context=told), clock)
    executor.tree.blackboard.set("object", "<script>")
    run = RunEvent("grasping", "Main", "kitchen", "panda", 7, str(folder), os.getpid(), 1000.0, 20.0, "simulated")
    with Telemetry(executor, run, folder, told) as telemetry:
        executor.after_tick = lambda: logging.getLogger("bestman_bt.somewhere").info("tick %d", executor.ticks)
        telemetry.end_as(executor.run())
    return folder


@pytest.fixture(scope="module")
def events(folder: Path) -> list[Event]:
    return list(read_events(folder))


def test_the_first_event_reports_what_runs_and_the_last_how_it_ended(events: list[Event]) -> None:
    assert isinstance(events[0], RunEvent)
    assert (events[0].task, events[0].scene, events[0].seed) == ("grasping", "kitchen", 7)
    assert isinstance(events[-1], EndEvent)
    assert (events[-1].outcome, events[-1].tree_status, events[-1].time) == ("failure", "FAILURE", pytest.approx(0.1))


def test_the_tree_is_reported_with_its_scopes_ports_and_parents(events: list[Event]) -> None:
    tree = next(event for event in events if isinstance(event, TreeEvent))
    nodes = {node.path: node for node in tree.nodes}
    assert [node.uid for node in tree.nodes] == list(range(1, 9))
    assert nodes["look"].ports == {"far": "true"}
    assert (nodes["look"].type, nodes["look"].category) == ("Look", "subtree")
    assert (nodes["look/note"].scope, nodes["look"].scope) == ("look", "")
    assert {node.category for node in tree.nodes} == {"control", "action", "subtree", "decorator"}
    assert nodes["look/note"].parent == nodes["look"].uid + 1
    assert 'ID="Main"' in tree.xml


def test_the_btlog_has_every_change_of_the_main_tree_and_the_events_what_its_nodes_said(
    folder: Path, events: list[Event]
) -> None:
    transitions = [(entry.time, entry.uid, entry.status) for entry in read_btlog(folder / "transitions.btlog")]
    assert transitions[0] == (0.0, 1, RUNNING)
    assert (pytest.approx(0.1), 2, FAILURE) in transitions
    assert transitions[-1][2] == IDLE
    said = [event for event in events if isinstance(event, StatesEvent) and event.tree == 0]
    assert [event.changes for event in said] == [[]] * len(said)
    assert [event.messages.get(2) for event in said] == ["at 100.00", "the <cup> slipped"]


def test_a_tree_that_a_leaf_ticks_is_told_under_the_leaf_with_its_states(events: list[Event]) -> None:
    inner = [event for event in events if isinstance(event, TreeEvent) and event.tree]
    assert [(event.id, event.under) for event in inner] == [("Plan", 2)]
    changes = [change for event in events if isinstance(event, StatesEvent) and event.tree for change in event.changes]
    assert (3, FAILURE) in changes


def test_blackboard_entries_are_reported_by_scope_when_they_change(events: list[Event]) -> None:
    told = [event for event in events if isinstance(event, BlackboardEvent)]
    assert told[0].entries[""]["object"].text == "<script>"
    assert told[-1].entries == {"look": {"seen": told[-1].entries["look"]["seen"]}}
    assert told[-1].entries["look"]["seen"].value == 3.0


def test_the_log_has_a_line_for_each_failure_with_node_code_and_words(folder: Path) -> None:
    failures = [(line.node, line.code, line.message) for line in read_log(folder) if line.level == "warning"]
    assert failures == [
        ("stuck", "", "AlwaysFailure failed"),
        ("grasp", "slipped", "the <cup> slipped"),
        ("look/gone", "", "AlwaysFailure failed"),
    ]


def test_the_log_is_json_lines_in_the_keys_of_structlog(folder: Path) -> None:
    lines = [json.loads(line) for line in (folder / "log.jsonl").read_text().splitlines()]
    assert lines[0]["event"] == "grasping begins: tree Main, seed 7"
    assert lines[-1]["event"] == "grasping ends: failure"
    slipped = next(line for line in lines if line.get("code"))
    assert slipped == {
        "time": pytest.approx(0.1),
        "level": "warning",
        "node": "grasp",
        "code": "slipped",
        "logger": "tree",
        "timestamp": "1970-01-01T00:16:40.100Z",
        "event": "the <cup> slipped",
    }


def test_what_packages_say_to_logging_is_in_it(folder: Path) -> None:
    said = [line for line in read_log(folder) if line.logger == "bestman_bt.somewhere"]
    assert [line.message for line in said[:2]] == ["tick 1", "tick 2"]
    assert logging.getLogger("bestman_bt").handlers == []


def test_an_execution_that_nobody_watches_is_not_listened_to() -> None:
    clock = ManualClock()
    executor = Executor(load_tree(INNER, clock=clock), clock)
    run = RunEvent("quiet", "Plan", "", "", 0, "", os.getpid(), time.time(), 20.0, "simulated")
    listened: list[bool] = []
    executor.after_tick = lambda: listened.append(bool(executor.tree._listeners))
    with Telemetry(executor, run):
        executor.run()
    assert listened
    assert not any(listened)


def test_a_slow_reader_receives_the_number_of_dropped_events_and_then_the_current_state() -> None:
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    tree = load_tree(INNER, clock=ManualClock())
    stream = EventStream()
    stream.start(None)
    stream.add(SubscriberQueue(ours, backlog=20_000), frozenset({"states"}))
    run = RunEvent("slow", "Plan", "", "", 0, "", 1, 0.0, 20.0, "simulated")
    nodes = TreeEvent([], "", tree.tree_id)
    stream.publish(lambda: (run, nodes))
    for tick in range(5000):
        stream.publish(lambda tick=tick: (StatesEvent(tick * 0.05, tick, [(1, 1 + tick % 2)], {1: f"tick {tick}"}),))
    time.sleep(0.5)
    lines = theirs.makefile("rb")
    told: list[Event] = []
    while not (told and isinstance(told[-1], DroppedEvent)):
        told.append(from_line(lines.readline()))
        stream.publish(lambda: (StatesEvent(251.0, 5001, [], {1: "now"}),))
    assert len(told) < 1000
    assert told[-1].count > 4000
    after = [from_line(lines.readline()) for _ in range(3)]
    assert [event.event for event in after] == ["run", "tree", "states"]
    assert after[2].messages == {1: "now"}
    stream.close()


def test_an_event_that_cannot_be_made_is_reported_and_the_others_still_come(tmp_path: Path) -> None:
    clock = ManualClock()
    executor = Executor(load_tree(INNER, clock=clock), clock)
    run = RunEvent("broken", "Plan", "", "", 0, str(tmp_path), os.getpid(), time.time(), 20.0, "simulated")

    def make() -> list[Event]:
        raise RuntimeError("of somebody's type")

    with Telemetry(executor, run, tmp_path) as telemetry:
        telemetry._stream.publish(make)
        telemetry.end_as(executor.run())
    assert any("RuntimeError: of somebody's type" in line.message for line in read_log(tmp_path))
    assert isinstance(list(read_events(tmp_path))[-1], EndEvent)


class Counting(StatefulAction):
    """Tells how many ticks it has run; after twenty it has done."""

    def on_start(self) -> int:
        self.count = 0
        return self.on_running()

    def on_running(self) -> int:
        self.count += 1
        self.feedback_message = f"{self.count}"
        return SUCCESS if self.count == 20 else RUNNING

    def on_halted(self) -> None:
        pass


def test_a_tree_that_was_read_again_is_told_below_the_same_leaf_and_the_old_one_falls_silent(tmp_path: Path) -> None:
    clock, registry, file = ManualClock(), NodeRegistry(), tmp_path / "t.xml"
    registry.register(Counting)
    text = '<root BTCPP_format="4"><BehaviorTree ID="M"><Sequence name="s">{}</Sequence></BehaviorTree></root>'
    file.write_text(text.format('<Counting name="c"/>'))

    def load(replaces: Tree | None = None) -> Tree:
        return load_tree(file, registry, clock=clock, replaces=replaces)

    executor = Executor(watched(load(), load, lambda words: None), clock)

    def save() -> None:
        if executor.ticks == 6:
            file.write_text(text.format('<Counting name="c"/><AlwaysSuccess name="new"/>'))
            os.utime(file, ns=(1, 1))

    executor.after_tick = save
    run = RunEvent("saved", "M", "", "", 0, str(tmp_path), os.getpid(), time.time(), 20.0, "simulated")
    with Telemetry(executor, run, tmp_path) as telemetry:
        telemetry.end_as(executor.run())
    told = list(read_events(tmp_path))
    trees = [event for event in told if isinstance(event, TreeEvent)]
    assert [(tree.tree, tree.under, len(tree.nodes)) for tree in trees] == [(0, None, 1), (1, 1, 2), (2, 1, 3)]
    states = [event for event in told if isinstance(event, StatesEvent) and event.time > 0.0]
    (idle,) = (event for event in states if event.tree == 1 and event.changes)
    assert idle.changes == [(1, IDLE), (2, IDLE)]
    after = [event for event in states if event.tree == 1 and event.tick > 7]
    assert not after
    assert (3, SUCCESS) in [change for event in states if event.tree == 2 for change in event.changes]


KILLED = """
import sys, time
from pathlib import Path
from bestman_bt.engine import WallClock, load_tree
from bestman_bt.records.events import RunEvent
from bestman_bt.runtime.executor import Executor
from bestman_bt.runtime.telemetry import Telemetry
folder = Path(sys.argv[1])
tree = load_tree('''<root BTCPP_format="4"><BehaviorTree ID="Main"><Repeat num_cycles="-1"><Sequence>
  <Script name="count" code="n += 1"/><Sleep name="rest" msec="20"/></Sequence></Repeat></BehaviorTree></root>''')
tree.blackboard.set("n", 0)
executor = Executor(tree, tree.clock, period=0.01)
executor.after_tick = lambda: print(executor.ticks, time.time(), flush=True)
run = RunEvent("killed", "Main", "", "", 0, str(folder), 1, time.time(), 100.0, "real")
with Telemetry(executor, run, folder):
    executor.run()
"""


def test_a_run_that_is_killed_can_be_read_to_half_a_second_before(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", KILLED, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    ticks = [line.split() for line in (process.stdout.readline() for _ in range(150))]
    process.send_signal(signal.SIGKILL)
    process.wait()
    killed = float(ticks[-1][1])
    events = list(read_events(tmp_path))
    started = next(event.started for event in events if isinstance(event, RunEvent))
    assert not any(isinstance(event, EndEvent) for event in events)
    log = read_btlog(tmp_path / "transitions.btlog")
    assert killed - (log.start + log.transitions[-1].time) < 0.5
    told = [event for event in events if isinstance(event, BlackboardEvent)]
    assert killed - (started + told[-1].time) < 0.5
    assert next(read_log(tmp_path)).message.startswith("killed begins")


@pytest.mark.parametrize(
    ("breaks", "outcome", "why"), [(True, "error", "the gear is stripped"), (False, "cancelled", "")]
)
def test_an_execution_that_nobody_has_ended_has_broken_or_was_cancelled(
    tmp_path: Path, breaks: bool, outcome: str, why: str
) -> None:
    clock = ManualClock()
    executor = Executor(load_tree(INNER, clock=clock), clock)
    run = RunEvent("broken", "Plan", "", "", 0, str(tmp_path), os.getpid(), 1000.0, 20.0, "simulated")
    with suppress(ValueError), Telemetry(executor, run, tmp_path):
        if breaks:
            raise ValueError(why)
    end = list(read_events(tmp_path))[-1]
    assert isinstance(end, EndEvent)
    assert (end.outcome, end.tree_status) == (outcome, "IDLE")
    assert [line.message for line in read_log(tmp_path)][-1].startswith(f"broken ends: {outcome}")
    assert why in [line.message for line in read_log(tmp_path)][-1]


def test_a_failure_is_reported_with_the_nodes_name_file_and_line(tmp_path: Path) -> None:
    (tmp_path / "my.xml").write_text(
        '<root BTCPP_format="4">\n<BehaviorTree ID="M">\n<AlwaysFailure/></BehaviorTree></root>'
    )
    tree = load_tree(tmp_path / "my.xml")
    executor = Executor(tree, ManualClock())
    (tmp_path / "run").mkdir()
    run = RunEvent("failing", "M", "", "", 0, str(tmp_path), os.getpid(), 1000.0, 20.0, "simulated")
    with Telemetry(executor, run, tmp_path / "run"):
        executor.run()
    (line,) = (line for line in read_log(tmp_path / "run") if line.level == "warning")
    assert (line.node, line.where) == ("AlwaysFailure::1", "AlwaysFailure (my.xml:3)")
