"""Publishes a running tree to Groot2, and serves its breakpoints and replaced results."""

from __future__ import annotations

import itertools
import struct
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bestman_bt.engine import IDLE, StateChanges, Tree
from bestman_bt.engine.xml.writer import XmlError, full_tree_xml
from bestman_bt.monitor.groot2.hooks import Groot2Hooks
from bestman_bt.monitor.groot2.protocol import (
    DEFAULT_PORT,
    Groot2Error,
    Request,
    RequestError,
    RequestKind,
    breakpoint_message,
    dump_blackboards,
    error_reply,
    import_zmq,
    reply,
)

if TYPE_CHECKING:
    import zmq


IDLE_AFTER = 10
"""Offset of the state that a node had before it became idle, which Groot2 draws faintly."""
MOST_TRANSITIONS = 1000
"""Largest number of transitions kept until they are fetched; older ones are dropped."""
_STATE = struct.Struct("<HB")
_MOST_MICROSECONDS = 2**48 - 1


class ObservedStates:
    """The states of ``tree``: stores changes in its thread and answers requests in another."""

    def __init__(self, tree: Tree) -> None:
        self._clock = tree.clock
        self._kept: deque[StateChanges] = deque()
        scopes = {board: position for position, board in enumerate(tree.blackboards.values())}
        nodes = sorted(tree.nodes, key=lambda node: (scopes[node.board], node.uid))
        self._states = {node.uid: node.state for node in nodes}
        self._shown = dict(self._states)
        self._transitions: deque[bytes] = deque(maxlen=MOST_TRANSITIONS)
        self._recording_since: float | None = None

    def on_changes(self, changes: StateChanges) -> None:
        """Store the changes of a tick."""
        self._kept.append(changes)

    def read_changes(self) -> None:
        """Process the stored changes; call it regularly, because they accumulate."""
        while self._kept:
            changes = self._kept.popleft()
            stamp = b""
            if self._recording_since is not None:
                passed = round((changes.stamp - self._recording_since) * 1e6)
                stamp = min(max(0, passed), _MOST_MICROSECONDS).to_bytes(6, "little")
            for uid, state in changes:
                self._shown[uid] = IDLE_AFTER + self._states[uid] if state == IDLE else state
                self._states[uid] = state
                if stamp:
                    self._transitions.append(stamp + _STATE.pack(uid, state))

    def status_bytes(self) -> bytes:
        """Return three bytes per node, SubTree by SubTree, in the order of creation: u16 uid, u8 state."""
        self.read_changes()
        return b"".join(_STATE.pack(uid, state) for uid, state in self._shown.items())

    def start_recording(self) -> bytes:
        """Record from now on, on the tree's clock; returns the time of day in microseconds since the epoch, as text."""
        self.read_changes()
        self._transitions.clear()
        self._recording_since = self._clock.now()
        return str(time.time_ns() // 1000).encode()

    def stop_recording(self) -> None:
        """Stop recording; the record stays available until it is fetched."""
        self.read_changes()
        self._recording_since = None

    def pop_transitions(self) -> bytes:
        """Return the transitions since the last call: u48 microseconds since the start, u16 uid, u8 state each."""
        self.read_changes()
        taken = b"".join(self._transitions)
        self._transitions.clear()
        return taken


MOST_NODES = 2**16 - 1
"""The protocol numbers nodes by 16 bits."""
MOST_BYTES = 1 << 20
LOOPBACK = "127.0.0.1"


@dataclass(eq=False)
class Groot2Publisher:
    """Serves one tree between ``open`` and ``close``; a context manager.

    A separate thread answers requests: a tick only stores its state changes, and waits only at breakpoints.

    ``host``, ``port``: the address for requests; breakpoints are published on the next port. ``intervened``: called, in
    the ticking thread, with each result that a hook gave instead of a node. ``heartbeat``: seconds without a request
    after which the client counts as gone and hooks are disabled. ``poll``: seconds between checks. ``most_bytes``: the
    maximum size of a message.

    """

    tree: Tree
    port: int = DEFAULT_PORT
    host: str = LOOPBACK
    intervened: Callable[[str], None] = lambda what: None
    heartbeat: float = 5.0
    poll: float = 0.05
    most_bytes: int = MOST_BYTES

    def __post_init__(self) -> None:
        self._states: ObservedStates
        self._uuid = uuid.uuid4().bytes
        self._xml = b""
        self._hooks = Groot2Hooks(self.tree, self._notify_breakpoint, self.intervened)
        self._identifiers = itertools.count(1)
        self._telling = threading.Lock()
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None
        self._context: zmq.Context[Any] | None = None
        self._requests: zmq.Socket[Any] | None = None
        self._breakpoints: zmq.Socket[Any] | None = None

    def open(self) -> Groot2Publisher:
        """Bind both ports and start to answer.

        Raises:
            Groot2Error: the extra is not installed, a port is in use, or the tree cannot be shown.
        """
        if len(self.tree.nodes) > MOST_NODES:
            raise Groot2Error(f"the tree has {len(self.tree.nodes)} nodes; Groot2 can distinguish {MOST_NODES}")
        try:
            self._xml = full_tree_xml(self.tree).encode()
        except XmlError as error:
            raise Groot2Error(str(error)) from error
        self._context, self._requests, self._breakpoints = _bound(self.port, self.host, self.most_bytes)
        self._states = ObservedStates(self.tree)
        self.tree.subscribe(self._states.on_changes)
        self._thread = threading.Thread(target=self._serve, name="groot2", daemon=True)
        self._thread.start()
        return self

    def close(self) -> None:
        """Release the ticks that breakpoints hold, and stop answering."""
        if self._thread is None:
            return
        self._closing.set()
        self.tree.unsubscribe(self._states.on_changes)
        self._hooks.remove_all()
        self._thread.join()
        self._thread = None
        with self._telling:
            if self._context is not None:
                self._context.destroy(linger=0)
            self._context = self._requests = self._breakpoints = None

    def __enter__(self) -> Groot2Publisher:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        import zmq

        assert self._requests is not None
        last_request, there = time.monotonic(), True
        while not self._closing.is_set():
            asked = self._requests.poll(round(self.poll * 1000)) != 0
            self._states.read_changes()
            if asked:
                last_request = time.monotonic()
            if there != (time.monotonic() - last_request < self.heartbeat):
                there = not there
                self._hooks.enable_all(there)
            if asked:
                parts = self._requests.recv_multipart()
                self._requests.send_multipart(self._answer(parts), zmq.DONTWAIT)

    def _answer(self, parts: list[bytes]) -> list[bytes]:
        try:
            request = Request.parse(parts)
            return reply(request, self._uuid, self._content(request))
        except RequestError as error:
            return error_reply(str(error))

    def _content(self, request: Request) -> bytes | None:
        """Carry out a request; return the second part of the reply."""
        match request.kind:
            case RequestKind.FULL_TREE:
                return self._xml
            case RequestKind.STATUS:
                return self._states.status_bytes()
            case RequestKind.BLACKBOARD:
                return dump_blackboards(self.tree, request.needed().decode(errors="replace"))
            case RequestKind.TOGGLE_RECORDING:
                if request.needed() == b"start":
                    return self._states.start_recording()
                if request.needed() == b"stop":
                    self._states.stop_recording()
            case RequestKind.TRANSITIONS:
                return self._states.pop_transitions()
            case _:
                return self._hooks.answer(request)
        return None

    def _notify_breakpoint(self, uid: int) -> None:
        import zmq

        with self._telling:
            if self._breakpoints is not None:
                self._breakpoints.send_multipart(breakpoint_message(next(self._identifiers), uid), zmq.DONTWAIT)


def check_servable(port: int = DEFAULT_PORT, host: str = LOOPBACK) -> None:
    """Check that a tree could be served. Raises Groot2Error if the extra is not installed or a port is in use."""
    context, _, _ = _bound(port, host)
    context.destroy(linger=0)


def _bound(
    port: int, host: str, most_bytes: int = MOST_BYTES
) -> tuple[zmq.Context[Any], zmq.Socket[Any], zmq.Socket[Any]]:
    """Return a context, the socket that answers and the one that announces breakpoints."""
    zmq = import_zmq()
    context = zmq.Context()
    sockets = []
    for kind, number in ((zmq.REP, port), (zmq.PUB, port + 1)):
        socket = context.socket(kind)
        socket.setsockopt(zmq.MAXMSGSIZE, most_bytes)
        address = f"tcp://{host}:{number}"
        try:
            socket.bind(address)
        except zmq.ZMQError as error:
            context.destroy(linger=0)
            raise Groot2Error(f"Groot2 cannot be served at {address}: {error}") from error
        sockets.append(socket)
    return context, sockets[0], sockets[1]
