"""What a publisher does for the executor's sake and against odd clients."""

from __future__ import annotations

import json
import random
import socket
import threading
import time
from collections import deque
from collections.abc import Iterator

import pytest

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, EngineError, ManualClock, NodeRegistry, Tree, load_tree
from bestman_bt.messages import Pose2D
from bestman_bt.monitor.groot2.hooks import Groot2Hooks
from bestman_bt.monitor.groot2.protocol import Groot2Error, dump_blackboards
from bestman_bt.monitor.groot2.publisher import Groot2Publisher, ObservedStates
from bestman_bt.runtime.executor import Execution, Executor, TerminationReason
from tests.monitor.groot2.wire_client import Groot2Client, groot2_client, hook
from tests.rigs.free_port import free_port

msgpack = pytest.importorskip("msgpack", reason="the extra groot2 is not installed")

XML = """<root BTCPP_format="4"><BehaviorTree ID="Main"><Sequence name="all"><AlwaysSuccess name="first"/>
<Sleep name="nap" msec="200"/></Sequence></BehaviorTree></root>"""
FIRST = 2


@pytest.fixture
def tree() -> Tree:
    return load_tree(XML, registry=NodeRegistry(), clock=ManualClock())


@pytest.fixture
def publisher(tree: Tree) -> Iterator[Groot2Publisher]:
    with Groot2Publisher(tree, free_port()) as serving:
        yield serving


@pytest.fixture
def client(publisher: Groot2Publisher) -> Iterator[Groot2Client]:
    with groot2_client(publisher.port) as asking:
        yield asking


def running(executor: Executor) -> tuple[threading.Thread, list[Execution]]:
    """The executor in a thread of its own, and where its end will be told."""
    ends: list[Execution] = []
    thread = threading.Thread(target=lambda: ends.append(executor.run()))
    thread.start()
    return thread, ends


def test_a_breakpoint_stops_simulated_time(tree: Tree, client: Groot2Client) -> None:
    client.ask("I", hook(FIRST, 0))
    thread, ends = running(Executor(tree, tree.clock))
    client.breakpoint()
    client.ask("S")
    time.sleep(0.2)
    assert tree.clock.now() == 0.0
    client.ask("U", {"uid": FIRST, "desired_status": "SKIPPED", "position": 0, "remove_when_done": False})
    thread.join(60.0)
    assert [(end.ending, end.tree_status) for end in ends] == [(TerminationReason.FINISHED, "SUCCESS")]


@pytest.mark.parametrize("position", [0, 1])
def test_a_cancelled_execution_leaves_a_breakpoint(tree: Tree, client: Groot2Client, position: int) -> None:
    client.ask("I", hook(FIRST, 0, position=position))
    executor = Executor(tree, tree.clock)
    thread, ends = running(executor)
    client.breakpoint()
    executor.cancel("enough")
    thread.join(60.0)
    assert [(end.ending, end.why) for end in ends] == [(TerminationReason.CANCELLED, "enough")]


def test_breakpoints_let_go_when_nobody_asks_any_more_and_hold_again_afterwards(tree: Tree) -> None:
    port = free_port()
    with Groot2Publisher(tree, port, heartbeat=2.0), groot2_client(port) as client:
        client.ask("I", hook(FIRST, 0))
        thread, ends = running(Executor(tree, tree.clock))
        client.breakpoint()
        thread.join(60.0)
        assert ends[0].tree_status == "SUCCESS"
        client.ask("S")
        assert json.loads(client.ask("D")[1])[0]["enabled"] is True


def test_closing_lets_go_what_a_breakpoint_holds(tree: Tree) -> None:
    port = free_port()
    with Groot2Publisher(tree, port), groot2_client(port) as client:
        client.ask("I", hook(FIRST, 0))
        thread, ends = running(Executor(tree, tree.clock))
        client.breakpoint()
    thread.join(60.0)
    assert ends[0].tree_status == "SUCCESS"
    assert tree.nodes[FIRST - 1].hooks is None


def test_a_hook_that_acts_once_is_gone_afterwards(tree: Tree, client: Groot2Client) -> None:
    client.ask("I", hook(FIRST, 1, "FAILURE", once=True))
    assert tree.tick_exactly_once() != RUNNING
    assert json.loads(client.ask("D")[1]) == []
    assert tree.tick_exactly_once() == RUNNING


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[" * 100_000,
        b"null",
        b"[1]",
        b"{}",
        b'{"enabled": true, "uid": "1", "mode": 0, "once": false, "desired_status": "SKIPPED", "position": 0}',
        b'{"enabled": true, "uid": 1, "mode": 7, "once": false, "desired_status": "SKIPPED", "position": 0}',
        b'{"enabled": true, "uid": 1, "mode": 0, "once": false, "desired_status": "WHAT", "position": 0}',
        b'{"enabled": true, "uid": -1, "mode": 0, "once": false, "desired_status": "SKIPPED", "position": 0}',
        "<script>ü".encode("latin-1"),
    ],
)
@pytest.mark.parametrize("letter", ["I", "U", "R"])
def test_damaged_requests_are_refused_and_the_next_ones_answered(
    client: Groot2Client, letter: str, content: bytes
) -> None:
    head, words = client.ask(letter, content)
    assert head == b"error"
    assert words
    assert json.loads(client.ask("D")[1]) == []


def test_random_bytes_are_answered(client: Groot2Client) -> None:
    generator = random.Random(5)
    for _ in range(300):
        parts = [generator.randbytes(generator.choice((0, 5, 6, 6, 7, 40))) for _ in range(generator.randint(1, 3))]
        assert client.send(*parts)
    assert client.states() == {1: 0, 2: 0, 3: 0}


def test_only_this_machine_is_served(publisher: Groot2Publisher) -> None:
    for port in (publisher.port, publisher.port + 1):
        socket.create_connection(("127.0.0.1", port), 2.0).close()
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection(("127.0.0.2", port), 2.0)


@pytest.mark.parametrize("taken", [0, 1])
def test_a_port_that_is_taken_is_named(tree: Tree, taken: int) -> None:
    port = free_port()
    with socket.socket() as other:
        other.bind(("127.0.0.1", port + taken))
        other.listen()
        with pytest.raises(Groot2Error, match=rf"127\.0\.0\.1:{port + taken}"):
            Groot2Publisher(tree, port).open()


def test_a_tree_that_has_been_served_is_served_again(tree: Tree) -> None:
    port = free_port()
    for _ in range(2):
        with Groot2Publisher(tree, port), groot2_client(port) as client:
            tree.tick_exactly_once()
            assert client.states()[1] == RUNNING


def test_states_from_before_it_was_opened_are_shown(tree: Tree) -> None:
    tree.tick_exactly_once()
    port = free_port()
    with Groot2Publisher(tree, port), groot2_client(port) as client:
        assert client.states() == {1: RUNNING, 2: SUCCESS, 3: RUNNING}


def test_values_of_all_kinds_are_shown_on_the_blackboard(tree: Tree) -> None:
    class Rude:
        def to_string(self) -> str:
            raise RuntimeError("no")

    values = {
        "pose": Pose2D(1.0, 2.0, 0.5),
        "yes": True,
        "large": 2**70,
        "list": [1, 0.1, "a"],
        "other": deque([1]),
        "rude": Rude(),
        "long": "x" * 5000,
        "real": float("inf"),
    }
    for key, value in values.items():
        tree.blackboard.set(key, value)
    shown = msgpack.unpackb(dump_blackboards(tree, "Main"))["Main"]
    assert shown == {
        "pose": repr(values["pose"]),
        "yes": True,
        "large": str(2**70),
        "list": [1, 0.1, "a"],
        "other": "deque([1])",
        "rude": "cannot be shown: RuntimeError",
        "long": "x" * 5000,
        "real": float("inf"),
    }


def test_a_breakpoint_is_not_let_go_by_what_was_asked_while_the_hook_replaced_a_result() -> None:
    tree = load_tree('<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>')
    hooks = Groot2Hooks(tree, lambda uid: tree.refuse_ticks() if breaks else None)
    breaks = False
    hooks.insert(json.dumps(hook(1, 1, "FAILURE")).encode())
    assert tree.tick_once() == FAILURE
    hooks.unlock(json.dumps({"uid": 1, "position": 0, "desired_status": "SUCCESS", "remove_when_done": False}).encode())
    breaks = True
    hooks.insert(json.dumps(hook(1, 0)).encode())
    with pytest.raises(EngineError, match="cancelled"):  # it was held up until the execution was cancelled
        tree.tick_once()


def test_a_breakpoint_that_was_let_go_holds_the_next_time() -> None:
    tree = load_tree('<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>')
    let_go = json.dumps({"uid": 1, "position": 0, "desired_status": "SKIPPED", "remove_when_done": False}).encode()
    met = []

    def reached(uid: int) -> None:
        met.append(uid)
        hooks.unlock(let_go) if len(met) == 1 else tree.refuse_ticks()

    hooks = Groot2Hooks(tree, reached)
    hooks.insert(json.dumps(hook(1, 0)).encode())
    assert tree.tick_once() == SUCCESS
    with pytest.raises(EngineError, match="cancelled"):  # it was held up until the execution was cancelled
        tree.tick_once()


def test_a_recording_holds_nothing_of_the_one_before(tree: Tree) -> None:
    states = ObservedStates(tree)
    tree.subscribe(states.on_changes)
    states.start_recording()
    tree.tick_exactly_once()
    states.stop_recording()
    tree.halt()
    states.start_recording()
    assert states.pop_transitions() == b""
    tree.tick_exactly_once()
    assert states.pop_transitions().startswith(bytes(6) + b"\x01\x00\x01"), "the root has begun to run, at 0 s"
