"""A BehaviorTree.CPP process is watched and recorded as one of our executors, through its publisher alone."""

from __future__ import annotations

import contextlib
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.engine import RUNNING, SUCCESS, ManualClock, Tree, load_tree
from bestman_bt.errors import Error
from bestman_bt.monitor.control_client import ControlError, request, running_executors
from bestman_bt.monitor.groot2.client import Groot2Client
from bestman_bt.monitor.groot2.protocol import Groot2Error, RequestError
from bestman_bt.monitor.groot2.publisher import Groot2Publisher, ObservedStates
from bestman_bt.monitor.groot2.watcher import Groot2Watcher, read_tree
from bestman_bt.monitor.groot2.zmtp import GREETING, frame_of
from bestman_bt.records.reader import read
from tests.monitor.conftest import wait_until
from tests.rigs.free_port import free_port

XML = """<root BTCPP_format="4" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence name="main">
<Script name="init" code="i := 3; s := 'text'"/><SubTree ID="Sub" name="sub" x="{i}"/></Sequence></BehaviorTree>
<BehaviorTree ID="Sub"><Sequence name="do"><AlwaysSuccess name="yes"/><Work name="work"/></Sequence></BehaviorTree>
</root>"""
OURS = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Repeat name="again" num_cycles="-1"><Sequence name="main">
<AlwaysSuccess name="first"/><AlwaysSuccess name="second"/></Sequence></Repeat></BehaviorTree></root>"""


class CppProcess:
    def __init__(self, folder: Path, port: int, xml: str = XML) -> None:
        file = folder / "tree.xml"
        file.write_text(xml)
        script = str(Path(__file__).with_name("behaviortreepy_publisher.py"))
        command = [sys.executable, script, str(file), str(port)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        assert self.line() == "ready"

    def line(self) -> str:
        assert self.process.stdout is not None
        return self.process.stdout.readline().strip()

    def begin_tick(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("tick\n")
        self.process.stdin.flush()

    def tick(self) -> str:
        self.begin_tick()
        return self.line()

    def kill(self) -> None:
        self.process.kill()
        self.process.communicate()


@contextmanager
def watched(port: int, runs: Path | None, said: list[str] | None = None, every_change: bool = True) -> Iterator[None]:
    watcher = Groot2Watcher("127.0.0.1", port, runs, ([] if said is None else said).append, every_change)
    watcher.start()
    try:
        yield
    finally:
        watcher.stop()


def ask(what: str, **more: Any) -> dict[str, Any]:
    (executor,) = running_executors()
    return request(executor, {"do": what, **more})


def tasks() -> list[str]:
    told = []
    for executor in running_executors():
        with contextlib.suppress(ControlError):  # it has just gone
            told.append(str(request(executor, {"do": "status"})["task"]))
    return told


def is_watched() -> bool:
    return len(running_executors()) == 1


def folders(runs: Path) -> list[Path]:
    return sorted(path for path in runs.iterdir() if path.is_dir())


def entries_of(runs: Path) -> dict[str, Any]:
    return read(folders(runs)[0]).blackboard_at(1e6)


@pytest.mark.slow
def test_a_process_of_behaviortree_cpp_is_watched_held_and_recorded(tmp_path: Path) -> None:
    pytest.importorskip("behaviortreepy", reason="the C++ engine's binding has no wheel for this platform")
    port, runs = free_port(), tmp_path / "runs"
    cpp = CppProcess(tmp_path, port)
    with watched(port, runs):
        wait_until(is_watched, "the process is found")
        cpp.tick()
        wait_until(lambda: ask("status")["active"] == ["sub/work"], "the running leaf is seen")
        ask("breakpoint", node="sub/work", when="before")
        cpp.begin_tick()
        wait_until(lambda: ask("status")["paused"], "it waits at the breakpoint")
        assert ask("status")["held_at"] == {"reason": "breakpoint", "node": "sub/work", "when": "before"}
        ask("force", node="sub/work", result="FAILURE")  # of the node that waits
        assert cpp.line() == "FAILURE"
        ask("clear_breakpoint", node="sub/work")
        ask("force", node="main", result="SUCCESS")
        assert cpp.tick() == "SUCCESS"
        ask("pause")
        cpp.begin_tick()
        wait_until(lambda: ask("status")["paused"], "it waits before the tick")
        ask("resume")
        cpp.line()
        with pytest.raises(ControlError, match="no 'stop'; use the process itself"):
            ask("stop")
        with pytest.raises(ControlError, match="no breakpoints with a condition"):
            ask("breakpoint", node="sub/work", when="before", condition="i > 2")
        ask("breakpoint", node="sub/work", when="after")
        wait_until(lambda: bool(entries_of(runs).get("")), "the blackboard is seen")
        assert {key: entry["value"] for key, entry in entries_of(runs)[""].items()} == {"i": 3, "s": "text"}
        cpp.kill()
        wait_until(lambda: not running_executors(), "its end is seen")
        cpp = CppProcess(tmp_path, port)
        wait_until(is_watched, "it is found again")
        wait_until(lambda: bool(ask("status")["breakpoints"]), "its breakpoints are set again")
        assert [point["path"] for point in ask("status")["breakpoints"]] == ["sub/work"]
        cpp.kill()
    first, second = (read(folder) for folder in folders(runs))
    assert [node.path for node in first.nodes][-1] == "sub/work"
    assert first.about["source"] == f"groot2://127.0.0.1:{port}"
    assert first.end is not None
    assert second.states.now.states[1:].tolist() == [0] * len(second.nodes)
    told = [(first.nodes.path_of(change.uid), change.status) for change in first.states.changes()][:5]
    assert told == [("main", RUNNING), ("init", SUCCESS), ("sub", RUNNING), ("sub/do", RUNNING), ("sub/yes", SUCCESS)]


@pytest.fixture
def begun(tmp_path: Path) -> Iterator[Tree]:
    """A tree of four nodes whose publisher is watched, with run folders in ``tmp_path``."""
    port, tree = free_port(), load_tree(OURS, clock=ManualClock())
    with Groot2Publisher(tree, port, poll=0.001), watched(port, tmp_path):
        wait_until(lambda: tasks() == ["Main"], "the process is found")
        yield tree


@pytest.mark.slow
def test_no_transition_is_lost(begun: Tree, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    begun.subscribe(lambda changes: told.extend(changes))
    for _ in range(60):
        begun.tick_exactly_once()
        time.sleep(0.01)
    wait_until(lambda: changes_of(tmp_path) == told, "all of them are recorded")
    assert len(told) > 200
    assert not gaps_of(tmp_path)


@pytest.mark.slow
def test_more_changes_than_the_process_keeps_are_a_gap_after_which_all_states_are_right(
    begun: Tree, tmp_path: Path
) -> None:
    told: list[tuple[int, int]] = []
    begun.subscribe(lambda changes: told.extend(changes))
    for _ in range(600):
        begun.tick_exactly_once()
    wait_until(lambda: bool(gaps_of(tmp_path)), "the gap is told")
    standing = [node.state for node in begun.nodes]
    wait_until(lambda: read(folders(tmp_path)[0]).states.now.states[1:].tolist() == standing, "all states are right")
    assert len(changes_of(tmp_path)) < len(told)


@pytest.mark.slow
def test_what_a_process_loses_itself_is_a_gap_after_which_all_states_are_right(
    begun: Tree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """BehaviorTree.CPP up to 4.9 sends zeros in place of changes that it records while it answers."""
    pop = ObservedStates.pop_transitions

    def last_as_zeros(states: ObservedStates) -> bytes:
        sent = pop(states)
        return sent[:-18] + bytes(len(sent[-18:]))

    begun.tick_exactly_once()
    wait_until(lambda: len(changes_of(tmp_path)) > 1, "the first tick is recorded")
    monkeypatch.setattr(ObservedStates, "pop_transitions", last_as_zeros)
    begun.tick_exactly_once()
    wait_until(lambda: gaps_of(tmp_path) == ["a gap: the process lost 2 changes"], "the gap is told")
    standing = [node.state for node in begun.nodes]
    wait_until(lambda: read(folders(tmp_path)[0]).states.now.states[1:].tolist() == standing, "all states are right")


@pytest.mark.slow
@pytest.mark.parametrize("asked", [True, False], ids=["refused", "not asked for"])
def test_of_a_process_that_records_nothing_the_states_are_looked_at(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, asked: bool
) -> None:
    recordings: list[None] = []

    def refuse(*_: object) -> None:
        recordings.append(None)
        raise RequestError("Request not recognized")

    monkeypatch.setattr(ObservedStates, "start_recording", refuse)
    port, tree = free_port(), load_tree(OURS, clock=ManualClock())
    with Groot2Publisher(tree, port), watched(port, tmp_path, every_change=asked):
        wait_until(lambda: tasks() == ["Main"], "the process is found")
        tree.tick_exactly_once()
        wait_until(lambda: ask("status")["root"] == "RUNNING", "its states are seen")
    (history,) = (read(folder) for folder in folders(tmp_path))
    assert bool(recordings) == asked
    assert any("changes are not recorded" in line.message for _, line in history.log)


def changes_of(runs: Path) -> list[tuple[int, int]]:
    return [(change.uid, change.status) for change in read(folders(runs)[0]).states.changes()]


def gaps_of(runs: Path) -> list[str]:
    log = read(folders(runs)[0]).log
    return [line.message for _, line in log if line.message.startswith("a gap")]


@pytest.mark.slow
def test_a_tree_that_changes_begins_another_run(tmp_path: Path) -> None:
    port = free_port()
    with watched(port, tmp_path):
        for name in ("One", "Other"):
            xml = OURS.replace("Main", name)
            with Groot2Publisher(load_tree(xml, clock=ManualClock()), port):
                wait_until(lambda name=name: name in tasks(), f"{name} is watched")
    assert [read(folder).about["tree"] for folder in folders(tmp_path)] == ["One", "Other"]


HEAD = struct.pack("<BBI", 2, ord("T"), 1) + bytes(16)
READY = frame_of(b"\x05READY", 4)


def answer(*parts: bytes) -> bytes:
    return b"".join(frame_of(part, 1) for part in (b"", *parts[:-1])) + frame_of(parts[-1], 0)


@pytest.mark.parametrize(
    ("sent", "complaint"),
    [
        (b"", "has closed the connection"),
        (b"HTTP/1.1 400 Bad Request\r\n" * 9, "does not speak ZeroMQ"),
        (GREETING.replace(b"NULL", b"CURV"), "demands the security"),
        (GREETING + frame_of(b"\x05ERROR\x03no!", 4), "refuses the connection"),
        (GREETING + READY + answer(HEAD[:9]), "does not speak Groot2's protocol"),
        (GREETING + READY + answer(b"\x01" + HEAD[1:], b"<root/>"), "version 1 of Groot2's protocol"),
        (GREETING + READY + answer(HEAD[:2] + b"\x09" + HEAD[3:], b"<root/>"), "answers a different request"),
        (GREETING + READY + answer(HEAD, b"<root"), "cannot be read"),
        (GREETING + READY + answer(HEAD, b"\xff\xfe"), "not UTF-8"),
        (
            GREETING + READY + answer(HEAD, b"<root><BehaviorTree ID='A'><Sequence _uid='7'/></BehaviorTree></root>"),
            "out of order",
        ),
        (GREETING + READY + answer(b"error", b"go away"), "go away"),
        (GREETING + READY + b"\x03" + (1 << 30).to_bytes(8, "big"), "1073741824 bytes"),
        (GREETING + READY + frame_of(b"", 1) * 100, "more than 8 parts"),
        (GREETING + READY + answer(HEAD, b"x" * 300)[:-50], "within a message"),
    ],
    ids=range(14),
)
def test_a_hostile_server_ends_in_a_clear_message(sent: bytes, complaint: str) -> None:
    with served(sent) as port, pytest.raises(Error, match=complaint) as found:
        read_tree(Groot2Client("127.0.0.1", port, timeout=5.0).full_tree(), "the process")
    assert len(str(found.value)) < 400


def test_half_a_message_is_not_waited_for_without_end() -> None:
    with (
        served(GREETING + READY + answer(HEAD, b"x" * 300)[:-50], stays=True) as port,
        pytest.raises(Groot2Error, match=r"not sent a whole message within 0\.1 s"),
    ):
        Groot2Client("127.0.0.1", port, timeout=0.1).full_tree()


@contextmanager
def served(sent: bytes, stays: bool = False) -> Iterator[int]:
    """Whoever connects is sent these bytes, whatever is asked."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        over = threading.Event()

        def serve() -> None:
            connection, _ = server.accept()
            with connection, contextlib.suppress(OSError):  # the client may have gone at the first wrong byte
                connection.sendall(sent)
                if not stays:
                    connection.shutdown(socket.SHUT_WR)
                over.wait(10.0)

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        yield server.getsockname()[1]
        over.set()
        thread.join(60.0)
