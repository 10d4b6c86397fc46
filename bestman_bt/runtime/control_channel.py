"""The control channel: a Unix socket to watch, pause, step, halt, change and stop an execution.

One JSON object per line in each direction. The answers are ``{"ok": true, …}`` or ``{"ok": false, "error": …}``. The
requests are:

- ``{"do": "status"}``, ``pause``, ``resume``, ``step``, ``halt``, ``stop``
- ``{"do": "decline"}``: refuse the motion that waits for confirmation; ``resume`` starts it
- ``{"do": "speed", "share": 0.05 to 1}``: scale the robot's speed; ``pause`` also stops motions on their way
- ``{"do": "set", "key": …, "value": …, "scope": …}``: set a blackboard entry; ``scope``: path of a SubTree, else the
  root; the answer has a ``note`` if the entry is new
- ``{"do": "breakpoint", "node": …, "when": "before" or "after", "condition": script, "once": false}``: hold the
  execution there, within the tick; nodes are given by uid or path
- ``{"do": "clear_breakpoint", "node": …, "when": …}``, ``{"do": "breakpoints"}``
- ``{"do": "force", "node": …, "result": "SUCCESS" or "FAILURE"}``: set the result of the node's next tick
- ``{"do": "subscribe", "topics": […]}``: after the answer, send events (see ``bestman_bt.records.events``): first the
  current state, then changes until the execution ends; all topics without ``topics``
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from bestman_bt.control.operator_speed import SLOWEST, OperatorSpeed
from bestman_bt.engine import RUNNING, EngineError, status_name
from bestman_bt.engine.spelling import closest
from bestman_bt.monitor.control_socket import Request, RequestRefusedError, serve, topics_of
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.events import BreakpointsEvent
from bestman_bt.runtime.breakpoints import BreakpointError, Breakpoints
from bestman_bt.runtime.confirmation import Confirmation
from bestman_bt.runtime.executor import Executor, PauseReason
from bestman_bt.runtime.telemetry import Telemetry

LONGEST_MARK = 200
"""Largest number of characters of a manual change in the result."""
TASK_WAIT = 2.0
"""Seconds that a task between ticks waits for the current tick."""

KNOWN = (
    "status, subscribe, pause, resume, step, decline, speed, set, breakpoint, clear_breakpoint, "
    "breakpoints, force, halt, stop"
)
"""The requests, as text for error messages."""


class ControlChannel:
    """Serves one executor; ``stop_robot`` is called immediately, from the serving thread: an emergency stop.

    ``robot_state``: returns the state of the robot and its parts as text, for ``status``. ``speed``: of the robot.
    """

    def __init__(
        self,
        executor: Executor,
        stop_robot: Callable[[], None],
        telemetry: Telemetry,
        robot_state: Callable[[], dict[str, dict[str, str]]] = lambda: {"parts": {}, "robot": {}},
        speed: OperatorSpeed | None = None,
        confirmation: Confirmation | None = None,
    ) -> None:
        self._executor = executor
        self._stop_robot = stop_robot
        self._telemetry = telemetry
        self._speed = speed or OperatorSpeed(lambda share: None)
        self._confirmation = confirmation or Confirmation()
        self._robot_state = robot_state
        self._breakpoints = Breakpoints(executor, self._publish_breakpoints)

    def serving(self, run_folder: Path | None = None) -> AbstractContextManager[Path]:
        """Serve until the context ends; ``control.sock`` in ``run_folder`` links to the socket."""
        return serve(self, run_folder)

    def answer(self, message: Any) -> dict[str, Any]:
        """Execute one request and return its answer; for ``subscribe`` the caller starts the events."""
        try:
            more = self._do(message)
        except (
            RequestRefusedError,
            BreakpointError,
            EngineError,
            ValueError,
            TypeError,
        ) as error:  # the last two: of converters
            return {"ok": False, "error": str(error)}
        executor = self._executor
        paused = executor.paused
        held_at = (executor.held_at or PauseReason()) if paused else None
        return {
            "ok": True,
            "task": self._telemetry.run.task,
            "pid": os.getpid(),
            "ticks": executor.ticks,
            "time": self._telemetry.now(),
            "paused": paused,
            "speed": self._speed.share,
            "held_at": None if held_at is None else _pause_document(held_at),
            "root": status_name(executor.tree.root.state),
            "breakpoints": self._breakpoints.documents(),
            **more,
        }

    def _standing(self) -> dict[str, Any]:
        """Return the detailed state for ``status``."""
        active = [node.path for node in self._executor.tree.nodes if node.state == RUNNING and not node.children]
        failure = self._telemetry.last_failure
        return {
            "run": Path(self._telemetry.run.folder).name,
            "folder": self._telemetry.run.folder,
            "active": active,
            "last_failure": None if failure is None else asdict(failure),
            **self._robot_state(),
        }

    def subscribe(self, message: Request, outbox: SubscriberQueue) -> None:
        """Start the events of a request that ``answer`` has accepted."""
        self._telemetry.subscribe(outbox, topics_of(message))

    def forget(self, outbox: SubscriberQueue) -> None:
        """Remove a subscriber."""
        self._telemetry.forget(outbox)

    def _drive(self, what: str) -> None:
        """Pause, resume, step, halt or stop."""
        executor = self._executor
        match what:
            case "stop":
                executor.cancel("stopped through the control channel")
                self._stop_robot()
                self._speed.resume()
            case "halt":
                executor.cancel("halted through the control channel")
                self._speed.resume()
            case "pause":
                executor.pause()
                self._speed.hold()  # at once, however long the tick under way takes
            case "resume":
                self._speed.resume()
                executor.resume()
            case "decline":
                if not self._confirmation.decline():
                    raise RequestRefusedError("no motion waits to be confirmed")
            case "step":
                self._speed.resume()
                executor.step()
                if not executor.wait_for_step(TASK_WAIT):
                    raise RequestRefusedError(f"the tick is still running after {TASK_WAIT:g} s; it pauses at its end")

    def _set_speed(self, share: Any) -> None:
        if isinstance(share, bool) or not isinstance(share, int | float):
            raise RequestRefusedError(f"speed should be a fraction of full speed, from {SLOWEST:g} to 1")
        self._speed.set(share)

    def _change_breakpoints(self, what: str, message: Any) -> None:
        node, when = message.get("node"), message.get("when")
        if what == "breakpoint":
            self._breakpoints.add(node, when, message.get("condition"), bool(message.get("once")))
        elif what == "clear_breakpoint":
            self._breakpoints.clear(node, when)
        else:
            self._breakpoints.force(node, message.get("result"))
            self._telemetry.intervened(f"{node} was forced to return {message.get('result')}")

    def _do(self, message: Any) -> dict[str, Any]:
        """Execute a request and return the additional fields of its answer."""
        what = message.get("do") if isinstance(message, dict) else None
        match what:
            case "speed":
                self._set_speed(message.get("share"))
            case "stop" | "halt" | "pause" | "resume" | "step" | "decline":
                self._drive(what)
            case "set":
                if "value" not in message:
                    raise RequestRefusedError("set needs a key (text) and a value")
                return self._set(message.get("key"), message.get("value"), message.get("scope") or "")
            case "breakpoint" | "clear_breakpoint" | "force":
                self._between_ticks(lambda: self._change_breakpoints(what, message))
            case "subscribe":
                topics_of(message)
            case "status":
                return self._standing()
            case "breakpoints":
                pass
            case _:
                raise RequestRefusedError(f"unknown request {what!r}; known: {KNOWN}")
        return {}

    def _set(self, key: Any, value: Any, scope: Any) -> dict[str, str]:
        if not isinstance(key, str) or not key:
            raise RequestRefusedError("set needs a key (text) and a value")
        board = self._executor.tree.blackboards.get(scope) if isinstance(scope, str) else None
        if board is None:
            raise RequestRefusedError(f"there is no SubTree {scope!r}")

        notes: dict[str, str] = {}
        key = board.shared_key(key)

        def write() -> None:
            if not board.is_registered(key) and key not in board:
                known = {*board.keys(), *board.remapping, *board.root.keys(), *board.registered()} - {key}
                meant = closest(key, sorted(known))
                hint = f"; did you mean {meant!r}?" if meant else ""
                notes["note"] = f"{key!r} is a new entry, which no node of the tree names{hint}"
            board.set(key, value)
            self._telemetry.entries_set()
            self._telemetry.intervened(f"{f'{scope}/' if scope else ''}{key} was set to {value!r}"[:LONGEST_MARK])

        self._between_ticks(write)
        return notes

    def _between_ticks(self, task: Callable[[], None]) -> None:
        """Run ``task`` in the executor's thread and wait for it; its exceptions propagate.

        A task that has not started in time is cancelled and refused.
        """
        asked = self._executor.between_ticks(task)
        try:
            asked.result(TASK_WAIT)
        except (CancelledError, TimeoutError) as error:
            asked.cancel()
            raise RequestRefusedError("the execution has ended") from error

    def _publish_breakpoints(self) -> None:
        self._telemetry.publish(BreakpointsEvent(self._breakpoints.documents()))


def _pause_document(hold: PauseReason) -> dict[str, Any]:
    """Return the reason of a pause without empty fields of a planned motion."""
    return {name: value for name, value in asdict(hold).items() if value or name not in ("words", "swept")}
