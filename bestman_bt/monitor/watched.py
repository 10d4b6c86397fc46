"""An external execution, shown and recorded like one of this package: run folder, control channel, events."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

from bestman_bt.engine.status import IDLE, RUNNING, STATUS_NAMES
from bestman_bt.errors import Error
from bestman_bt.monitor.control_socket import Request, RequestRefusedError, serve, topics_of
from bestman_bt.monitor.event_stream import EventStream, StateSnapshot
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.events import (
    EndEvent,
    Event,
    Level,
    LogEvent,
    PausedEvent,
    RunEvent,
    StatesEvent,
    TreeEvent,
)
from bestman_bt.records.reader import OUTCOMES
from bestman_bt.records.writer import RunLogWriter, make_folder

LONGEST_NAME = 60


class WatchedExecution:
    """A watched execution, a context manager: every monitor of this user finds it; it is recorded below ``runs`` if
    given.

    ``control``: executes requests other than ``status``, or raises RequestRefusedError; called from other threads.

    Raises:
        OSError: the folder cannot be made.
    """

    def __init__(self, run: RunEvent, tree: TreeEvent, runs: Path | None, control: Callable[[Request], None]) -> None:
        log = None
        if runs is not None:
            folder = make_folder(runs.absolute(), f"{datetime.now():%Y%m%d-%H%M%S}-{file_name(run.task)}")
            run = replace(run, folder=str(folder))
            log = RunLogWriter(folder, tree.xml, run)
        self.run, self.tree = run, tree
        self.standing = StateSnapshot()
        self._result = IDLE
        self._control = control
        self._stack = ExitStack()
        self._stream = EventStream()
        self._stream.start(log)
        self.publish(run)
        self.publish(tree)

    def __enter__(self) -> WatchedExecution:
        folder = Path(self.run.folder) if self.run.folder else None
        self._stack.enter_context(serve(self, folder))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        self._stream.close()

    def publish(self, event: Event) -> bool:
        """Publish and record an event. Returns False if it was lost."""
        self.standing.take(event)
        return self._stream.publish(lambda: (event,))

    def publish_states(
        self, time: float, changes: list[tuple[int, int]], messages: dict[int, str] | None = None
    ) -> bool:
        """Publish the state changes of one moment, in order. ``time``: seconds since the start. Returns False if
        lost.
        """
        for uid, state in changes:
            if uid == 1 and state != IDLE:
                self._result = state
        now = self.standing
        return self.publish(StatesEvent(max(now.time, time), now.tick + 1, changes, messages or {}))

    def log(self, level: Level, message: str) -> None:
        """Publish a line of the log."""
        self.publish(LogEvent(self.standing.time, level, message, logger=__name__))

    def end(self, why: str) -> None:
        """End the execution with the root's last result, succeeded or failed, or else as cancelled."""
        outcome = OUTCOMES.get(self._result, "cancelled")
        self.log("info" if outcome == "success" else "warning", f"{self.run.task} ends: {outcome}: {why}")
        self.publish(EndEvent(self.standing.time, outcome, STATUS_NAMES[self._result], why))

    def answer(self, message: Any) -> dict[str, Any]:
        """Execute one request of the control channel."""
        what = message.get("do") if isinstance(message, dict) else None
        try:
            if what == "subscribe":
                topics_of(message)
            elif what != "status":
                self._control(message if isinstance(message, dict) else {})
        except Error as error:
            return {"ok": False, "error": str(error)}
        now = self.standing
        return {
            "ok": True,
            "task": self.run.task,
            "pid": self.run.pid,
            "ticks": now.tick,
            "time": now.time,
            "paused": now.paused is not None,
            "speed": 1.0,
            "held_at": None if now.paused is None else _held_at(now.paused),
            "breakpoints": now.breakpoints,
            "root": STATUS_NAMES[now.states[1]],
            "run": Path(self.run.folder).name,
            "folder": self.run.folder,
            "active": [node.path for node in self.tree.nodes if node.is_leaf and now.states[node.uid] == RUNNING],
            "last_failure": None,
            "parts": {},
            "robot": {},
        }

    def subscribe(self, message: Request, outbox: SubscriberQueue) -> None:
        """Start sending the events of a subscription."""
        self._stream.add(outbox, topics_of(message))

    def forget(self, outbox: SubscriberQueue) -> None:
        """Send no more events to ``outbox``."""
        self._stream.forget(outbox)


def file_name(text: str) -> str:
    """Return ``text`` in a form that can be part of a file name."""
    return re.sub(r"[^\w.-]+", "_", text)[:LONGEST_NAME].strip(".") or "tree"


def _held_at(paused: PausedEvent) -> dict[str, Any]:
    return {"reason": paused.reason, "node": paused.node, "when": paused.when}


def refuse(message: Request) -> None:
    """Refuse a request to an execution that can only be watched."""
    raise RequestRefusedError(
        f"this execution is only watched: {message.get('do')!r} has to be requested from its own process"
    )
