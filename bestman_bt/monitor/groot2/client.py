"""A Groot2 client: reads the tree, states, blackboards and recorded transitions of a process, and sets hooks on
nodes.
"""

from __future__ import annotations

import json
import select
import threading
from typing import Any

import numpy as np

from bestman_bt.engine import IDLE
from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import SKIPPED
from bestman_bt.monitor.groot2.protocol import PROTOCOL, Groot2Error, Request, RequestError, RequestKind, import_zmq
from bestman_bt.monitor.groot2.zmtp import ZmtpConnection

TIMEOUT = 3.0
"""Time limit for a complete answer, seconds."""
IDLE_AFTER = 10
_HEADER, _REPLY_HEADER = 6, 22
_TRANSITION = np.dtype([("time", "<u4"), ("time_high", "<u2"), ("uid", "<u2"), ("status", "u1")])
_STATE = np.dtype([("uid", "<u2"), ("status", "u1")])
LONGEST_ERROR = 300


class TreeChangedError(Groot2Error):
    """The tree of the process has changed."""


class Groot2Client:
    """A connection for requests and one for breakpoints; thread-safe.

    Raises:
        Groot2Error: no process answers, or it violates version 2 of the protocol. Each request raises it too,
            ``RequestError`` if the process refuses, and ``TreeChangedError``.
    """

    def __init__(self, host: str, port: int, timeout: float = TIMEOUT) -> None:
        self._host, self._port, self._timeout = host, port, timeout
        self._address = f"{host}:{port}"
        self._asking = threading.Lock()
        self._number = 0
        self._tree = b""
        self._requests = ZmtpConnection(host, port, "REQ", timeout)
        self._breakpoints: ZmtpConnection | None = None

    def close(self) -> None:
        """End both connections."""
        self._requests.close()
        if self._breakpoints is not None:
            self._breakpoints.close()

    def ask(self, kind: RequestKind, content: bytes | None = None) -> bytes:
        """Return the second part of the answer to one request."""
        with self._asking:
            self._number += 1
            header = Request(kind, self._number, content).header()
            self._requests.send(b"", header, *([] if content is None else [content]))
            parts = self._requests.receive()
        if len(parts) < 2 or parts[0] != b"":
            raise Groot2Error(f"{self._address} does not answer like a ZeroMQ request socket")
        head, *rest = parts[1:]
        if head == b"error":
            raise RequestError(b" ".join(rest)[:LONGEST_ERROR].decode(errors="replace"))
        if len(head) != _REPLY_HEADER:
            raise Groot2Error(f"{self._address} does not speak Groot2's protocol: an answer begins with {head[:24]!r}")
        if head[0] != PROTOCOL:
            raise Groot2Error(f"{self._address} speaks version {head[0]} of Groot2's protocol; {PROTOCOL} is supported")
        if head[1:_HEADER] != header[1:]:
            raise Groot2Error(f"{self._address} answers a different request from the one sent")
        if self._tree not in (b"", head[_HEADER:]):
            raise TreeChangedError(f"{self._address} now has a different tree")
        self._tree = head[_HEADER:]
        return rest[0] if rest else b""

    def full_tree(self) -> str:
        """Return the XML of the tree, with numbers of nodes."""
        try:
            return self.ask(RequestKind.FULL_TREE).decode()
        except UnicodeDecodeError as error:
            raise Groot2Error(f"{self._address} sends a tree that is not UTF-8: {error}") from error

    def states(self) -> dict[int, int]:
        """Return the states by uid."""
        read = self._records(self.ask(RequestKind.STATUS), _STATE)
        states = np.where(read["status"] >= IDLE_AFTER, IDLE, read["status"])
        self._check(states)
        return dict(zip(read["uid"].tolist(), states.tolist(), strict=True))

    def record(self) -> float:
        """Start to record transitions. Returns the time in the process, seconds since the epoch, at which the record
        starts.
        """
        reply = self.ask(RequestKind.TOGGLE_RECORDING, b"start")
        try:
            return min(max(0.0, int(reply) * 1e-6), 1e11)
        except ValueError as error:
            raise Groot2Error(
                f"{self._address} reports a recording since {reply[:40]!r}, which is not a time"
            ) from error

    def stop_recording(self) -> None:
        """Stop recording."""
        self.ask(RequestKind.TOGGLE_RECORDING, b"stop")

    def transitions(self) -> tuple[Transitions, int]:
        """Return the transitions since the last call, of which the process keeps 1,000, and the number of lost ones.
        BehaviorTree.CPP up to 4.9 computes the size of its answer before it locks the record: transitions recorded in
        between are sent as zeros. No node has the uid 0.
        """
        read = self._records(self.ask(RequestKind.TRANSITIONS), _TRANSITION)
        self._check(read["status"])
        kept = read[read["uid"] != 0]
        times = (kept["time"] + kept["time_high"] * 2.0**32) * 1e-6
        return Transitions(times, kept["uid"].copy(), kept["status"].copy()), len(read) - len(kept)

    def blackboards(self, names: list[str]) -> dict[str, dict[str, Any]]:
        """Return blackboard name → key → value, for the existing blackboards."""
        import msgpack

        content = self.ask(RequestKind.BLACKBOARD, ";".join(names).encode())
        try:
            reply = msgpack.unpackb(content) if content else None
        except (ValueError, TypeError, RecursionError) as error:
            raise Groot2Error(f"{self._address} sends blackboards that are not MessagePack: {error!r}") from error
        boards = reply if isinstance(reply, dict) else {}
        return {str(name): entries for name, entries in boards.items() if isinstance(entries, dict)}

    def insert_hook(self, uid: int, position: int, mode: int, once: bool, result: str = "SKIPPED") -> None:
        """Set a hook before or after a node, or change the existing one; see ``hooks``."""
        hook = {"enabled": True, "uid": uid, "position": position, "mode": mode, "once": once, "desired_status": result}
        self.ask(RequestKind.INSERT_HOOK, json.dumps(hook).encode())

    def remove_hook(self, uid: int, position: int) -> None:
        """Remove a hook, and release a tick that it holds."""
        self.ask(RequestKind.REMOVE_HOOK, json.dumps({"uid": uid, "position": position}).encode())

    def unlock(self, uid: int, position: int, result: str, remove: bool) -> None:
        """Release the tick that a breakpoint holds, with ``result`` for the node, or SKIPPED."""
        asked = {"uid": uid, "position": position, "desired_status": result, "remove_when_done": remove}
        self.ask(RequestKind.UNLOCK_BREAKPOINT, json.dumps(asked).encode())

    def hooks(self) -> list[dict[str, Any]]:
        """Return the hooks that are set, including those of other clients."""
        try:
            reply = json.loads(self.ask(RequestKind.DUMP_HOOKS) or b"[]")
        except (ValueError, RecursionError) as error:
            raise Groot2Error(f"{self._address} sends hooks that are not JSON: {error}") from error
        return [hook for hook in reply if isinstance(hook, dict)] if isinstance(reply, list) else []

    def listen(self) -> None:
        """Receive breakpoint notifications from now on, on the next port."""
        self._breakpoints = ZmtpConnection(self._host, self._port + 1, "SUB", self._timeout)

    def reached(self) -> int | None:
        """Return the uid of the next node whose hook a tick has reached, or None if there is no further one."""
        if self._breakpoints is None or not select.select([self._breakpoints], [], [], 0)[0]:
            return None
        parts = self._breakpoints.receive()
        reply = parts[-1]
        return int(reply) if len(parts) == 2 and reply.isdigit() and len(reply) < 6 else 0

    def _records(self, content: bytes, form: np.dtype[Any]) -> np.ndarray[Any, np.dtype[Any]]:
        if len(content) % form.itemsize:
            words = f"{len(content)} bytes, which is not a multiple of {form.itemsize}"
            raise Groot2Error(f"{self._address} sends states of {words}")
        return np.frombuffer(content, form)

    def _check(self, states: np.ndarray[Any, np.dtype[Any]]) -> None:
        if len(states) and int(states.max()) > SKIPPED:
            raise Groot2Error(f"{self._address} sends the state {int(states.max())}; there are 0 to {SKIPPED}")


def parse_address(given: str) -> tuple[str, int]:
    """Return host and port of ``groot2://HOST:PORT``. Raises Groot2Error for anything else."""
    scheme, mark, place = given.partition("://")
    host, _, port = place.rpartition(":")
    if not mark or scheme != "groot2" or not host or not port.isdigit() or not 0 < int(port) < 65535:
        words = f"{given!r} is not the address of a process: groot2://HOST:PORT, such as groot2://127.0.0.1:1667"
        if scheme == "groot1":
            words = f"{given!r}: the protocol of the first Groot (BehaviorTree.CPP 3) is not supported"
        raise Groot2Error(words)
    import_zmq()
    return host.strip("[]"), int(port)
