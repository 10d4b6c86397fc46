"""The control channel: a real socket, an execution in a thread, clients that behave and clients that do not."""

from __future__ import annotations

import errno
import json
import os
import signal
import socket
import stat
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from py_trees.behaviour import Behaviour
from py_trees.common import Access, Status

from behaviours.failure import NodeFailure
from bestman_bt.control.operator_speed import OperatorSpeed
from bestman_bt.engine import RUNNING, SUCCESS, ManualClock, NodeRegistry, StatefulAction, build_tree, load_tree
from bestman_bt.monitor import control_socket
from bestman_bt.monitor.control_client import ControlError, request, running_executors, socket_folder
from bestman_bt.monitor.control_socket import serve
from bestman_bt.records.events import EndEvent, Event, RunEvent, StatesEvent, from_line
from bestman_bt.runtime import control_channel
from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.executor import Execution, Executor, TerminationReason
from bestman_bt.runtime.telemetry import BlackboardChanges, Telemetry

TREE = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Repeat num_cycles="-1" name="again"><Blink name="blink"/></Repeat>
</BehaviorTree></root>"""
SHORT = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess name="yes"/></BehaviorTree></root>'


class Blink(StatefulAction):
    """RUNNING in one tick, SUCCESS in the next: each tick changes states."""

    def on_start(self) -> int:
        return RUNNING

    def on_running(self) -> int:
        return SUCCESS


@dataclass
class Served:
    """An execution that others control, and what became of it."""

    executor: Executor
    channel: ControlChannel
    telemetry: Telemetry
    socket: Path
    folder: Path
    stops: list[float] = field(default_factory=list)
    speeds: list[float] = field(default_factory=list)
    execution: Execution | None = None
    finished: threading.Event = field(default_factory=threading.Event)

    def ask(self, what: str, **more: Any) -> dict[str, Any]:
        return request(self.socket, {"do": what, **more})

    def wait(self) -> Execution:
        assert self.finished.wait(60.0)
        assert self.execution is not None
        return self.execution

    def ticks_after(self, number: int) -> None:
        end = time.monotonic() + 60.0
        while self.executor.ticks <= number:
            assert time.monotonic() < end, f"it stays at tick {self.executor.ticks}"
            time.sleep(0.005)


@pytest.fixture(autouse=True)
def own_sockets(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sockets of these tests are apart from those of anybody's robots."""
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path_factory.mktemp("run")))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    """A tree that ticks about a thousand times a second until it is stopped."""
    registry = NodeRegistry()
    registry.register(Blink)
    clock = ManualClock()
    executor = Executor(load_tree(TREE, registry, clock=clock), clock, after_tick=lambda: time.sleep(0.001))
    stops: list[float] = []
    telemetry = Telemetry(executor, described("blinking"))
    speeds: list[float] = []
    speed = OperatorSpeed(speeds.append)
    executor.watchers.append(speed)
    channel = ControlChannel(executor, lambda: stops.append(clock.now()), telemetry, speed=speed)
    with telemetry, channel.serving(tmp_path) as path:
        served = Served(executor, channel, telemetry, path, tmp_path, stops, speeds)

        def run() -> None:
            served.execution = executor.run()
            served.finished.set()

        thread = threading.Thread(target=run)
        thread.start()
        yield served
        executor.cancel()
        thread.join(60.0)


def described(task: str) -> RunEvent:
    return RunEvent(task, "Main", "", "", 0, "", os.getpid(), time.time(), 1000.0, "simulated")


def subscribe(connection: socket.socket) -> Iterator[Event]:
    """The events of all topics until the connection ends."""
    connection.sendall(b'{"do": "subscribe"}\n')
    lines = connection.makefile("rb")
    assert json.loads(lines.readline())["ok"]
    return (from_line(line) for line in lines)


def connect(path: Path) -> socket.socket:
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    connection.settimeout(5.0)
    connection.connect(str(path))
    return connection


def test_the_socket_is_for_its_user_only_and_linked_from_the_run_folder(served: Served) -> None:
    mode = served.socket.stat().st_mode
    assert stat.S_ISSOCK(mode)
    assert stat.S_IMODE(mode) == 0o600
    assert stat.S_IMODE(served.socket.parent.stat().st_mode) == 0o700
    link = served.folder / "control.sock"
    assert link.is_symlink()
    assert link.resolve() == served.socket.resolve()
    assert request(link, {"do": "status"})["ok"]


def test_socket_and_link_are_gone_afterwards(tmp_path: Path) -> None:
    clock = ManualClock()
    executor = Executor(load_tree(SHORT, clock=clock), clock)
    telemetry = Telemetry(executor, described("short"))
    with telemetry, ControlChannel(executor, lambda: None, telemetry).serving(tmp_path) as path:
        assert path.exists()
    assert not path.exists()
    assert not (tmp_path / "control.sock").is_symlink()
    with pytest.raises(ControlError, match="no executor answers at"):
        request(path, {"do": "status"})


def test_without_a_folder_there_is_no_link_and_afterwards_nobody_serves(tmp_path: Path) -> None:
    def serving() -> list[threading.Thread]:
        return [thread for thread in threading.enumerate() if thread.name == "control-channel"]

    before = serving()
    clock = ManualClock()
    executor = Executor(load_tree(SHORT, clock=clock), clock)
    telemetry = Telemetry(executor, described("short"))
    with telemetry, ControlChannel(executor, lambda: None, telemetry).serving() as path:
        assert request(path, {"do": "status"})["ok"]
        (thread,) = (thread for thread in serving() if thread not in before)
        assert thread.daemon
        path.unlink()  # by somebody who tidies up: no reason to fail
    assert serving() == before
    assert list(tmp_path.iterdir()) == []


def test_status_tells_task_process_ticks_and_root(served: Served) -> None:
    served.ticks_after(2)
    answer = served.ask("status")
    assert (answer["task"], answer["pid"], answer["paused"]) == ("blinking", os.getpid(), False)
    assert answer["root"] in ("RUNNING", "IDLE")
    assert answer["ticks"] > 2
    assert answer["time"] > 0.0


def test_stop_stops_the_robot_and_cancels_the_execution(served: Served) -> None:
    assert served.ask("stop")["ok"]
    assert len(served.stops) == 1
    execution = served.wait()
    assert (execution.ending, execution.why) == (TerminationReason.CANCELLED, "stopped through the control channel")


def test_stop_reaches_the_robot_while_a_tick_goes_on_and_also_when_nothing_runs_any_more(served: Served) -> None:
    begun, release = threading.Event(), threading.Event()

    def long_tick() -> None:
        begun.set()
        release.wait(5.0)

    served.executor.after_tick = long_tick
    assert begun.wait(5.0)
    try:
        assert served.ask("stop")["ok"]
        assert len(served.stops) == 1
        assert not served.finished.is_set()
    finally:
        release.set()
    assert served.wait().ending is TerminationReason.CANCELLED
    assert served.ask("stop")["ok"]
    assert len(served.stops) == 2


def test_what_is_set_and_forced_by_hand_is_noted_for_the_result(served: Served) -> None:
    served.channel.answer({"do": "pause"})
    assert served.channel.answer({"do": "set", "key": "speed", "value": 3})["ok"]
    assert served.channel.answer({"do": "force", "node": 2, "result": "SUCCESS"})["ok"]
    assert [mark.partition(" s: ")[2] for mark in served.telemetry.interventions] == [
        "speed was set to 3",
        "2 was forced to return SUCCESS",
    ]


def test_after_the_end_nothing_can_be_set_any_more(served: Served) -> None:
    served.ask("halt")
    served.wait()
    with pytest.raises(ControlError, match="the execution has ended"):
        served.ask("set", key="speed", value=3)
    assert served.ask("status")["root"] == "IDLE"


def test_an_entry_is_set_in_the_scope_that_is_named(tmp_path: Path) -> None:
    xml = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><SubTree ID="In" name="in"/>
        </BehaviorTree><BehaviorTree ID="In"><Script name="own" code="speed := 1"/></BehaviorTree></root>"""
    clock = ManualClock()
    executor = Executor(load_tree(xml, clock=clock), clock)
    channel = ControlChannel(executor, lambda: None, Telemetry(executor, described("scopes")))
    answers = []
    thread = threading.Thread(
        target=lambda: answers.extend(
            channel.answer({"do": "set", "key": "speed", "value": value, "scope": scope})
            for value, scope in ((3, ""), (4, "in"), (5, "out"), (6, 7), (7, None))
        )
    )
    thread.start()
    executor.pause()
    running = threading.Thread(target=executor.run)
    running.start()
    thread.join(60.0)
    boards = executor.tree.blackboards
    assert (boards[""].get("speed"), boards["in"].get("speed")) == (7, 4)
    executor.cancel()
    running.join(60.0)
    assert [answer["ok"] for answer in answers] == [True, True, False, False, True]
    assert [answer["error"] for answer in answers[2:4]] == ["there is no SubTree 'out'", "there is no SubTree 7"]


class Counts(Behaviour):
    """A native behaviour: adds one to ``steps`` at each tick, and alone may write ``odometer``."""

    def __init__(self) -> None:
        super().__init__("counts")
        self.blackboard = self.attach_blackboard_client("counts")
        self.blackboard.register_key("steps", access=Access.WRITE)
        self.blackboard.register_key("odometer", access=Access.EXCLUSIVE_WRITE)
        self.blackboard.register_key("limit", access=Access.READ)
        self.blackboard.steps = 0

    def update(self) -> Status:
        self.blackboard.steps += 1
        return Status.RUNNING


def test_what_is_set_reaches_native_behaviours_or_is_refused_with_the_reason() -> None:
    clock = ManualClock()
    executor = Executor(build_tree(Counts(), clock=clock), clock)
    channel = ControlChannel(executor, lambda: None, Telemetry(executor, described("native")))
    executor.pause()
    running = threading.Thread(target=executor.run)
    running.start()
    ok = channel.answer({"do": "set", "key": "/steps", "value": 1_000_000})
    limit = channel.answer({"do": "set", "key": "limit", "value": 9})
    refused = channel.answer({"do": "set", "key": "odometer", "value": 3})
    misspelt = channel.answer({"do": "set", "key": "stepz", "value": 3})
    executor.resume()
    while executor.ticks < 2:
        time.sleep(0.001)
    executor.cancel()
    running.join(60.0)
    assert ok["ok"]
    assert misspelt["note"].endswith("; did you mean 'steps'?")
    assert "note" not in {*ok, *limit}  # both are entries that a node of the tree names
    assert executor.tree.blackboard["steps"] > 1_000_000
    assert not refused["ok"]
    assert "the py_trees client 'counts' has exclusive write access" in refused["error"]
    assert [entry.key for entry in BlackboardChanges(executor.tree).collect()] == ["steps", "limit", "stepz"]


def test_serving_leaves_the_rights_of_new_files_as_they_were(served: Served, tmp_path: Path) -> None:
    mask = os.umask(0o022)
    os.umask(mask)
    assert mask != 0o177
    (tmp_path / "new").touch()
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o666 & ~mask


def test_the_folder_of_sockets_is_made_private_and_refused_where_it_is_somebody_elses(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = tmp_path / f"bestman-bt-{os.getuid()}"
    folder.mkdir(mode=0o777)
    folder.chmod(0o777)
    assert socket_folder() == folder
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    monkeypatch.setattr("os.getuid", lambda: 54321)
    with pytest.raises(ControlError, match="bestman-bt-54321"):
        socket_folder()


def test_halt_cancels_the_execution_and_leaves_the_robot_its_commands(served: Served) -> None:
    served.ask("halt")
    assert served.wait().why == "halted through the control channel"
    assert served.stops == []


def test_pause_step_and_resume(served: Served) -> None:
    for _ in range(20):  # answered before the executor's thread has taken notice
        paused, resumed = served.ask("pause"), served.ask("resume")
        assert (paused["paused"], paused["held_at"]) == (True, {"reason": "asked", "node": None, "when": None})
        assert (resumed["paused"], resumed["held_at"]) == (False, None)
    assert served.ask("pause")["paused"]
    time.sleep(0.1)
    ticks = served.ask("status")["ticks"]
    time.sleep(0.1)
    assert served.ask("status")["ticks"] == ticks
    served.ask("step")
    served.ticks_after(ticks)
    time.sleep(0.1)
    answer = served.ask("status")
    assert (answer["ticks"], answer["paused"]) == (ticks + 1, True)
    assert not served.ask("resume")["paused"]
    served.ticks_after(ticks + 5)


def test_a_pause_lets_the_robot_wait_at_once_and_going_on_lets_it_go_on(served: Served) -> None:
    asked = [served.ask("pause"), served.ask("speed", share=0.3), served.ask("step"), served.ask("resume")]
    assert [answer["speed"] for answer in asked] == [1.0, 0.3, 0.3, 0.3]
    assert served.speeds[:2] == [0.0, 0.0]  # held, and still so when the speed was set
    assert [speed for speed, _ in groupby(served.speeds)] == [0.0, 0.3, 0.0, 0.3]  # for the one tick, and once resumed
    with pytest.raises(ControlError, match="a speed is 5% to 100%"):
        served.ask("speed", share=2)
    with pytest.raises(ControlError, match="speed should be a fraction"):
        served.ask("speed", share="fast")


@pytest.mark.parametrize("end", ["resume", "halt", "stop"])
def test_motions_wait_and_go_on_at_once_and_not_at_the_next_tick(end: str) -> None:
    clock, speeds = ManualClock(), list[float]()
    executor = Executor(load_tree(SHORT, clock=clock), clock)
    speed = OperatorSpeed(speeds.append)
    channel = ControlChannel(executor, lambda: None, Telemetry(executor, described("short")), speed=speed)
    assert channel.answer({"do": "pause"})["ok"]
    assert speeds == [0.0]
    assert channel.answer({"do": end})["ok"]
    assert speeds == [0.0, 1.0]


def test_a_paused_execution_can_be_stopped(served: Served) -> None:
    served.ask("pause")
    served.ask("stop")
    assert served.wait().ending is TerminationReason.CANCELLED


def test_set_writes_an_entry_between_ticks_also_while_paused(served: Served) -> None:
    served.ask("set", key="speed", value=3)
    assert served.executor.tree.blackboard.get("speed") == 3
    served.ask("pause")
    served.ask("set", key="speed", value=4)
    assert served.executor.tree.blackboard.get("speed") == 4


def test_a_value_of_the_wrong_type_is_refused_and_the_run_goes_on(served: Served) -> None:
    served.ask("set", key="speed", value=3)
    with pytest.raises(ControlError, match="speed"):
        served.ask("set", key="speed", value="fast")
    served.ticks_after(served.executor.ticks + 3)


@pytest.mark.parametrize(
    ("line", "error"),
    [
        (b"stop\n", "a request should be one JSON object per line"),
        (b'"stop"\n', "unknown request None; known: status, subscribe, pause"),
        (b'{"do": "jump"}\n', "unknown request 'jump'; known: status"),
        (b'{"do": ["stop"]}\n', "unknown request"),
        (b'{"do": "set", "key": 3}\n', "set needs a key"),
    ],
)
def test_a_request_that_makes_no_sense_is_answered_and_harms_nothing(served: Served, line: bytes, error: str) -> None:
    with connect(served.socket) as connection, connection.makefile("rb") as answers:
        connection.sendall(line)
        answer = json.loads(answers.readline())
        assert answer["ok"] is False
        assert error in answer["error"]
        connection.sendall(b'{"do": "status"}\n')
        assert json.loads(answers.readline())["ok"]


def test_a_subscriber_is_told_how_all_stands_then_every_change_and_the_end(served: Served) -> None:
    with connect(served.socket) as connection:
        told = subscribe(connection)
        first = [next(told) for _ in range(3)]
        assert [event.event for event in first] == ["run", "tree", "states"]
        blink = next(node for node in first[1].nodes if node.path == "blink")
        assert (blink.uid, blink.parent, blink.category, blink.type) == (2, 1, "action", "Blink")
        assert dict(first[2].changes).keys() == {1, 2}
        changes = [next(told) for _ in range(20)]
        served.ask("stop")
        served.wait()
        states = [event for event in [*changes, *_until_the_end(told)] if isinstance(event, StatesEvent)]
    times = [event.time for event in states]
    assert times == sorted(times)
    ticks = [event.tick for event in states]
    assert ticks[:-1] == list(range(ticks[0], ticks[0] + len(ticks) - 1))
    assert {state for event in states for uid, state in event.changes if uid == 2} == {0, 1, 2}
    assert states[-1].changes[-1] == (1, 0)


def _until_the_end(told: Iterator[Event]) -> Iterator[Event]:
    for event in told:
        yield event
        if isinstance(event, StatesEvent) and event.changes[-1] == (1, 0):
            return


def test_a_subscriber_is_told_the_end_and_then_its_connection_ends(tmp_path: Path) -> None:
    clock = ManualClock()
    executor = Executor(load_tree(SHORT, clock=clock), clock)
    telemetry = Telemetry(executor, described("short"))
    with telemetry, ControlChannel(executor, lambda: None, telemetry).serving(tmp_path) as path:
        connection = connect(path)
        told = subscribe(connection)
        telemetry.end_as(executor.run())
    events = list(told)
    connection.close()
    assert [state for event in events if isinstance(event, StatesEvent) for _, state in event.changes] == [0, 2, 0]
    assert isinstance(events[-1], EndEvent)
    assert (events[-1].outcome, events[-1].tree_status) == ("success", "SUCCESS")


def test_only_the_topics_that_were_asked_for_come(served: Served) -> None:
    with connect(served.socket) as connection, connection.makefile("rb") as lines:
        connection.sendall(b'{"do": "subscribe", "topics": ["blackboard"]}\n')
        assert json.loads(lines.readline())["ok"]
        served.ask("set", key="speed", value=3)
        events = (from_line(line) for line in lines)
        while (event := next(events)).event != "blackboard" or not event.entries:
            assert event.event in ("run", "tree", "blackboard")
    assert event.entries[""]["speed"].value == 3


def test_a_subscriber_that_never_reads_does_not_hold_up_the_run(served: Served) -> None:
    with connect(served.socket) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        subscribe(connection)
        served.executor.after_tick = None
        served.ticks_after(served.executor.ticks + 2_000)  # more than the socket holds
        assert served.ask("status")["ok"]
        served.ask("stop")
        served.wait()


def test_running_executors_are_found_and_dead_sockets_are_cleared_away(served: Served) -> None:
    dead = served.socket.parent / "1-dead.sock"
    with socket.socket(socket.AF_UNIX) as left:
        left.bind(str(dead))
    assert running_executors() == [served.socket]
    assert not dead.exists()


def test_an_executor_that_was_killed_leaves_nothing_after_the_next_command(tmp_path: Path) -> None:
    code = (
        "import os, sys\nfrom pathlib import Path\nfrom bestman_bt.monitor.control_socket import serve\n"
        "with serve(None, Path(sys.argv[1])):\n    os.kill(os.getpid(), 9)"
    )
    runs = [tmp_path / "first", tmp_path / "second"]
    for run in runs:
        run.mkdir()
        assert subprocess.run([sys.executable, "-c", code, run], check=False).returncode == -signal.SIGKILL
        assert (run / "control.sock").is_symlink()
    with serve(Mock(), runs[1]) as path:  # an evaluation goes on in the folder of an episode that was killed
        assert running_executors() == [path]
        assert sorted(entry.name for entry in socket_folder().iterdir()) == [f"{path.stem}.folder", path.name]
        assert not (runs[0] / "control.sock").is_symlink()
        assert (runs[1] / "control.sock").resolve() == path.resolve()
    assert list(socket_folder().iterdir()) == list(runs[1].iterdir()) == []


def test_an_executor_that_begins_while_others_are_looked_for_keeps_its_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[list[Path]] = []

    def listen(server: control_socket._Server) -> None:
        found.append(running_executors())
        server.socket.listen()

    monkeypatch.setattr(control_socket._Server, "server_activate", listen)
    with serve(Mock(), None) as path:
        found.append(running_executors())
    assert found == [[], [path]]


def test_a_folder_whose_path_is_too_long_for_a_socket_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / ("long" * 30)
    folder.mkdir()
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    with pytest.raises(ControlError, match="no control socket .*too long"), serve(Mock(), None):
        pass


def test_an_executor_that_is_too_busy_to_answer_keeps_its_socket() -> None:
    path = socket_folder() / "2-busy.sock"
    with socket.socket(socket.AF_UNIX) as busy, ExitStack() as waiting:
        busy.bind(str(path))
        busy.listen(0)
        refused = 0
        while refused == 0:  # until no more can wait
            asking = waiting.enter_context(socket.socket(socket.AF_UNIX))
            asking.setblocking(False)
            refused = asking.connect_ex(str(path))
        assert refused == errno.EAGAIN
        assert running_executors() == [path]
        assert path.exists()


def test_a_flood_of_requests_does_not_slow_the_executor(served: Served) -> None:
    with connect(served.socket) as connection:
        connection.setblocking(False)
        flood = b'{"do": "set", "key": "speed", "value": 3}\n' * 2000
        sent = connection.send(flood)
        assert sent > 10_000
        first = served.executor.ticks
        time.sleep(0.5)
        assert served.executor.ticks - first > 20
        assert served.ask("status")["ok"]


def test_what_was_refused_because_the_tree_did_not_tick_is_not_done_later(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bestman_bt.runtime.control_channel.TASK_WAIT", 0.01)
    clock = ManualClock()
    executor = Executor(load_tree(SHORT, NodeRegistry(), clock=clock), clock)
    run = RunEvent("late", "Main", "", "", 0, "", os.getpid(), time.time(), 20.0, "simulated")
    channel = ControlChannel(executor, lambda: None, Telemetry(executor, run))
    for asked in ({"do": "set", "key": "n", "value": 1}, {"do": "force", "node": "yes", "result": "FAILURE"}):
        assert channel.answer(asked) == {"ok": False, "error": "the execution has ended"}
    assert executor.run().tree_status == "SUCCESS"
    assert "n" not in executor.tree.blackboard


def test_a_disconnected_subscriber_receives_no_further_events(served: Served) -> None:
    telemetry = served.telemetry
    with connect(served.socket) as connection:
        connection.sendall(b'{"do": "subscribe", "topics": []}\n')
        assert json.loads(connection.makefile("rb").readline())["ok"]
        end = time.monotonic() + 60.0
        while not telemetry._subscribers:
            assert time.monotonic() < end, "nobody has subscribed"
            time.sleep(0.005)
    while telemetry._subscribers:
        assert time.monotonic() < end, "who has gone still subscribes"
        time.sleep(0.005)


def test_status_reports_the_active_leaves_and_the_robot(served: Served) -> None:
    served.ask("pause")
    answers = [
        served.ask("status") if number == 0 else served.ask("step") and served.ask("status") for number in (0, 1)
    ]
    assert {path for answer in answers for path in answer["active"]} == {"blink"}
    assert (answers[0]["parts"], answers[0]["last_failure"], answers[0]["run"]) == ({}, None, "")


def test_status_reports_the_last_failure_of_an_action() -> None:
    clock = ManualClock()
    executor = Executor(load_tree(SHORT, clock=clock), clock)
    telemetry = Telemetry(executor, described("failing"))
    telemetry.last_failure = NodeFailure("Main/grasp", "no_grasp", "nothing to hold", "grasp (my.xml:4)")
    channel = ControlChannel(executor, lambda: None, telemetry, lambda: {"parts": {"arm": "ok"}, "robot": {}})
    answer = channel.answer({"do": "status"})
    assert answer["last_failure"] == {
        "node": "Main/grasp",
        "error_code": "no_grasp",
        "why": "nothing to hold",
        "where": "grasp (my.xml:4)",
        "stamp": 0.0,
        "part": "",
        "vendor_code": "",
        "obstacle": None,
    }
    assert answer["parts"] == {"arm": "ok"}


def test_a_step_is_answered_once_it_is_done(served: Served) -> None:
    served.ask("pause")
    ticks = served.ask("status")["ticks"]
    for number in range(1, 20):
        answer = served.ask("step")
        assert (answer["ticks"], answer["paused"]) == (ticks + number, True)


def test_a_step_that_is_asked_for_within_a_tick_is_the_next_one(served: Served) -> None:
    within, go_on = threading.Event(), threading.Event()

    def late() -> None:
        within.set()
        go_on.wait(5.0)

    served.executor.after_tick = late
    assert within.wait(5.0)
    served.ask("pause")
    ticks = served.executor.ticks
    threading.Timer(0.05, go_on.set).start()
    assert served.ask("step")["ticks"] == ticks + 1
    assert served.speeds[:2] == [0.0, 1.0]  # motions go on for it, though the loop never paused


def test_a_step_that_takes_long_is_reported(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(control_channel, "TASK_WAIT", 0.05)
    served.ask("pause")
    served.executor.after_tick = lambda: time.sleep(0.5)
    with pytest.raises(ControlError, match=r"still running after 0\.05 s"):
        served.ask("step")


def test_set_without_a_value_is_refused_and_null_is_a_value(served: Served) -> None:
    with pytest.raises(ControlError, match="set needs a key"):
        served.ask("set", key="cup")
    assert served.ask("set", key="cup", value=None)["ok"]


def test_a_breakpoint_at_a_name_or_a_type_is_answered_by_the_paths_of_such_nodes(served: Served) -> None:
    nodes = served.executor.tree.nodes
    for node in nodes[1:]:
        with pytest.raises(ControlError, match=f"did you mean .*{node.path!r}"):
            served.ask("breakpoint", node=f"elsewhere/{node.type_id}", when="before")


def test_a_breakpoint_at_a_misspelt_node_is_answered_by_the_closest_path(served: Served) -> None:
    with pytest.raises(ControlError, match="there is no node 'blnk'.*did you mean 'blink'"):
        served.ask("breakpoint", node="blnk", when="before")
