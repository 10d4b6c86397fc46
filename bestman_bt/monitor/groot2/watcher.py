"""Watches a process through Groot2's protocol, across restarts, and shows each execution like one of this package."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from itertools import islice
from pathlib import Path
from typing import Any, Literal

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.errors import Error
from bestman_bt.monitor.control_socket import Request, RequestRefusedError
from bestman_bt.monitor.groot2.client import Groot2Client, TreeChangedError
from bestman_bt.monitor.groot2.hooks import Mode, Position
from bestman_bt.monitor.groot2.protocol import Groot2Error, RequestError
from bestman_bt.monitor.groot2.publisher import MOST_TRANSITIONS
from bestman_bt.monitor.watched import WatchedExecution, file_name
from bestman_bt.records.described_tree import describe_xml
from bestman_bt.records.events import (
    BlackboardEvent,
    BreakpointsEvent,
    DescribedNode,
    PausedEvent,
    ResumedEvent,
    RunEvent,
    ShownEntry,
    TreeEvent,
)
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.shown_value import REMOVED, show_value

POLL = 0.02
"""Seconds between two requests for transitions: the process keeps 1,000, so up to 50,000 per second are possible."""
LOOK = 0.05
"""Seconds between two requests for the states of a process that does not record changes."""
BLACKBOARD_PERIOD = 1.0
BLACKBOARD_SHARE = 20
"""Factor by which blackboards are requested less often: the process answers nothing else while it writes them."""
RETRY = 0.2
"""Seconds between two attempts to reach a process."""
WAS_FINE = 5.0
"""Seconds of watching after which the reason for its end is reported, even if the same reason was reported before."""
MOST_REACHED = 1000
"""Largest number of breakpoints read at a time."""
ONE_MOMENT = 1e-3
"""Largest time between transitions that are reported with the same time, seconds."""
ROOT = 1
_WHEN: dict[Position, Literal["before", "after"]] = {Position.BEFORE: "before", Position.AFTER: "after"}
_POSITIONS = {when: position for position, when in _WHEN.items()}


def _print(words: str) -> None:
    sys.stderr.write(f"bestman-bt: {words}\n")
    sys.stderr.flush()


class Groot2Watcher:
    """Watches the process at ``host``:``port`` between ``start`` and ``stop``, in a separate thread.

    ``runs``: the folder for run folders and for the breakpoints of each tree; None records nothing. ``log``: called
    once for each problem while it persists. ``every_change``: let the process record its changes of state; else its
    states are read every ``LOOK`` seconds.
    """

    def __init__(
        self, host: str, port: int, runs: Path | None, log: Callable[[str], None] = _print, every_change: bool = True
    ) -> None:
        self._host, self._port, self._runs, self._log = host, port, runs, log
        self._every_change = every_change
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._watch, name=f"groot2 {host}:{port}", daemon=True)

    def start(self) -> None:
        """Start looking for the process in a thread."""
        self._thread.start()

    def stop(self) -> None:
        """End the watched executions; the process continues."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _watch(self) -> None:
        said, place = "", f"{self._host}:{self._port}"
        address = f"groot2://{place}"
        while not self._stopping.is_set():
            began = time.monotonic()
            try:
                client = Groot2Client(self._host, self._port)
                try:
                    _Session(client, address, self._runs, self._stopping, self._every_change).follow()
                finally:
                    client.close()
            except TreeChangedError:
                continue
            except (Error, OSError) as error:
                if str(error) != said or time.monotonic() - began > WAS_FINE:
                    said = str(error)
                    self._log(f"{'' if place in said else f'{address}: '}{said}; trying again")
            self._stopping.wait(RETRY)


class _Session:
    """One execution, from the first answer of a process to its last."""

    def __init__(
        self, client: Groot2Client, address: str, runs: Path | None, stopping: threading.Event, every_change: bool
    ) -> None:
        self._client, self._stopping = client, stopping
        tree = read_tree(client.full_tree(), address)
        self._recorded, started = every_change, time.time()
        if every_change:
            try:
                started = client.record()
            except RequestError:
                self._recorded = False
        self._began = time.monotonic()
        self._scopes = {node.scope or tree.id: node.scope for node in tree.nodes}
        self._nodes = {node.uid: node for node in tree.nodes}
        self._standing: dict[int, int] | None = client.states()
        self._entries: dict[tuple[str, str], ShownEntry] = {}
        self._blackboards_due = 0.0
        self._points = _Breakpoints(client, self._nodes, runs and runs / f"{file_name(tree.id)}.breakpoints.json")
        run = RunEvent(tree.id, tree.id, "", "", 0, "", 0, started, 0.0, "real", source=address)
        self._shown = WatchedExecution(run, tree, runs, self._control)
        self._points.publish = self._shown.publish

    def follow(self) -> None:
        """Follow the process until it is gone, has another tree, or the watching ends; raises the reason."""
        with self._shown as shown:
            shown.log("info", f"watching {shown.run.source}: {len(self._nodes)} nodes")
            why = "the watching ended"
            try:
                self._listen()
                while not self._stopping.wait(POLL if self._recorded else LOOK):
                    self._take_changes()
                    self._take_breakpoints()
                    self._take_blackboards()
                if self._recorded:
                    self._client.stop_recording()
            except (Error, OSError) as error:
                why = str(error)
                raise
            finally:
                self._points.forget_pause()
                shown.end(why)

    def _listen(self) -> None:
        try:
            self._client.listen()
        except Groot2Error as error:
            self._shown.log("warning", f"breakpoints cannot be followed: {error}")
        self._points.restore(self._client.hooks())
        if not self._recorded:
            self._shown.log(
                "warning", f"changes are not recorded: a state that lasts less than {LOOK} s may not be seen"
            )

    def _now(self) -> float:
        return time.monotonic() - self._began

    def _take_changes(self) -> None:
        """Record the changes since the last poll: all states at the beginning or after a gap, then the recorded
        transitions.
        """
        if not self._recorded:
            self._publish_states(self._client.states(), set())
            return
        news, lost = self._client.transitions()
        while (lost or len(news) >= MOST_TRANSITIONS) and not self._stopping.is_set():
            why = [f"the process lost {lost} changes"] if lost else []
            if len(news) + lost >= MOST_TRANSITIONS:
                why.append(f"{len(news)} changes at once, as many as the process keeps; some are lost")
            self._shown.log("warning", f"a gap: {'; '.join(why)}")
            self._publish_changes(news)
            self._standing = self._client.states()
            news, lost = self._client.transitions()
        if self._standing is not None:
            standing, self._standing = self._standing, None
            self._publish_states(standing, set(news.uids.tolist()))
        self._publish_changes(news)

    def _publish_states(self, standing: dict[int, int], but: set[int]) -> None:
        """Publish all states, ``but`` those whose changes follow."""
        shown = self._shown.standing.states
        changes = [(uid, state) for uid, state in standing.items() if uid not in but and shown.get(uid, state) != state]
        if changes:
            self._shown.publish_states(self._now(), changes)

    def _publish_changes(self, news: Transitions) -> None:
        begin, moment = 0, list(zip(news.uids.tolist(), news.statuses.tolist(), strict=True))
        times = news.times.tolist()
        for end in range(1, len(times) + 1):
            if end == len(times) or times[end] - times[begin] > ONE_MOMENT:
                self._shown.publish_states(times[begin], moment[begin:end])
                begin = end

    def _take_breakpoints(self) -> None:
        for uid in islice(iter(self._client.reached, None), MOST_REACHED):
            self._points.reached(uid, self._shown.standing.time)

    def _take_blackboards(self) -> None:
        began = time.monotonic()
        if began < self._blackboards_due:
            return
        told = self._client.blackboards(list(self._scopes))
        passed = time.monotonic() - began
        self._blackboards_due = began + max(BLACKBOARD_PERIOD, BLACKBOARD_SHARE * passed)
        now = {
            (self._scopes.get(name, name), str(key)): show_value(value)
            for name, entries in told.items()
            for key, value in entries.items()
        }
        news = {place: entry for place, entry in now.items() if self._entries.get(place) != entry}
        news |= {place: REMOVED for place in self._entries if place not in now}
        self._entries = now
        boards: dict[str, dict[str, ShownEntry]] = {}
        for (scope, key), entry in news.items():
            boards.setdefault(scope, {})[key] = entry
        if boards:
            shown = self._shown.standing
            self._shown.publish(BlackboardEvent(max(shown.time, self._now()), shown.tick, boards))

    def _control(self, asked: Request) -> None:
        """Carry out a request for the execution, from any thread."""
        node, when = asked.get("node"), asked.get("when", "before")
        match asked.get("do"):
            case "pause":
                self._points.pause()
            case "resume":
                self._points.resume()
            case "step":
                self._points.step()
            case "breakpoints":
                pass
            case "breakpoint":
                if asked.get("condition"):
                    raise RequestRefusedError("Groot2's protocol has no breakpoints with a condition")
                self._points.add(self._found(node), _position(when), bool(asked.get("once")))
            case "clear_breakpoint":
                uid = None if node is None else self._found(node)
                self._points.clear(uid, None if asked.get("when") is None else _position(when))
            case "force":
                self._points.force(self._found(node), str(asked.get("result")))
                self._shown.log("warning", f"by hand: {node} was forced to return {asked.get('result')}")
            case what:
                raise RequestRefusedError(f"Groot2's protocol has no {what!r}; use the process itself")

    def _found(self, node: Any) -> int:
        named = [uid for uid, known in self._nodes.items() if node in (uid, known.path)]
        if len(named) != 1:
            raise RequestRefusedError(f"{len(named) or 'no'} nodes have the path or number {node!r}")
        return named[0]


def read_tree(xml: str, address: str) -> TreeEvent:
    """Return the tree as an event. Raises the errors of reading logs, and EventError for uids out of order."""
    tree = describe_xml(xml, address)
    NodeList().add(tree)
    return tree


def _position(when: Any) -> Position:
    if when not in _POSITIONS:
        raise RequestRefusedError("when is 'before' or 'after'")
    return _POSITIONS[when]


class _Breakpoints:
    """Those that were set from here, kept in ``file`` by path, and where the tree waits. May be used from any thread.

    A pause is a breakpoint before the root, and a step executes one tick.
    """

    def __init__(self, client: Groot2Client, nodes: dict[int, DescribedNode], file: Path | None) -> None:
        self._client, self._nodes, self._file = client, nodes, file
        self._set: dict[tuple[int, Position], bool] = {}
        self._forced: dict[int, str] = {}
        self._holding: deque[tuple[int, Position]] = deque()
        self._last: dict[int, Position] = {}
        self._pausing = False
        self._lock = threading.RLock()
        self.publish: Callable[[Any], Any] = lambda event: None
        self._time = 0.0

    def restore(self, standing: Iterable[dict[str, Any]]) -> None:
        """Set those again that were kept; what others have set is listed, too."""
        with self._lock:
            for hook in standing:
                uid, position = hook.get("uid"), hook.get("position")
                if hook.get("mode") == Mode.BREAKPOINT and uid in self._nodes and position in tuple(Position):
                    self._set[uid, Position(position)] = bool(hook.get("once"))
            places = {node.path: node.uid for node in self._nodes.values()}
            for path, when, once in self._kept():
                uid, position = places.get(path), _POSITIONS[when]
                if uid is not None and (uid, position) not in self._set:
                    self._client.insert_hook(uid, position, Mode.BREAKPOINT, once)
                    self._set[uid, position] = once
            if self._set:
                self._changed()

    def add(self, uid: int, position: Position, once: bool) -> None:
        """Hold before or after a node."""
        with self._lock:
            self._client.insert_hook(uid, position, Mode.BREAKPOINT, once)
            self._set[uid, position] = once
            self._changed()

    def clear(self, uid: int | None, position: Position | None) -> None:
        """Clear the breakpoints of a node, or all; a tick that waits at one continues."""
        with self._lock:
            for place in [(u, p) for u, p in self._set if uid in (None, u) and position in (None, p)]:
                self._client.remove_hook(*place)
                del self._set[place]
                self._let_go(place)
            self._changed()

    def force(self, uid: int, result: str) -> None:
        """Let a waiting node return ``result`` now, another one when it is ticked next."""
        with self._lock:
            if (uid, Position.BEFORE) in self._holding:
                self._client.unlock(uid, Position.BEFORE, result, self._set.get((uid, Position.BEFORE), False))
                self._let_go((uid, Position.BEFORE))
            elif (uid, Position.BEFORE) in self._set:
                raise RequestRefusedError(
                    "there is a breakpoint before this node: force it where it waits there, or clear it"
                )
            else:
                self._client.insert_hook(uid, Position.BEFORE, Mode.REPLACE, True, result)
                self._forced[uid] = result

    def pause(self) -> None:
        """Hold before the next tick."""
        with self._lock:
            if (ROOT, Position.BEFORE) not in self._set:
                self._client.insert_hook(ROOT, Position.BEFORE, Mode.BREAKPOINT, False)
                self._pausing = True

    def resume(self) -> None:
        """Let a waiting node continue."""
        with self._lock:
            if self._pausing:
                self._client.remove_hook(ROOT, Position.BEFORE)
                self._pausing = False
                self._let_go((ROOT, Position.BEFORE))
            self._unlock()

    def step(self) -> None:
        """Run one tick."""
        with self._lock:
            self.pause()
            self._unlock()

    def reached(self, uid: int, now: float) -> None:
        """Handle a notification that a tick has come to the hook of a node."""
        with self._lock:
            self._time = now
            if self._forced.pop(uid, None) is not None:  # its result was replaced: nothing waits
                return
            places = [(uid, p) for p in Position if (uid, p) in self._set or (self._pausing and (uid, p) == (ROOT, 0))]
            if not places:
                return
            # Where there is one before and one after, they are met in turn.
            place = places[0] if len(places) == 1 or self._last.get(uid) != Position.BEFORE else places[1]
            self._last[uid] = place[1]
            self._holding.append(place)
            asked = self._pausing and place == (ROOT, Position.BEFORE)
            node = self._nodes[uid]
            held = PausedEvent(now, "breakpoint", node.path, _WHEN[place[1]])
            self.publish(PausedEvent(now, "asked") if asked else held)
            if self._set.get(place):  # once
                del self._set[place]
                self._changed()

    def forget_pause(self) -> None:
        """Clear the pause: the process is gone."""
        if self._holding:
            self.publish(ResumedEvent(self._time))

    def _unlock(self) -> None:
        for uid, position in list(self._holding):
            self._client.unlock(uid, position, "SKIPPED", False)
            self._let_go((uid, position))

    def _let_go(self, place: tuple[int, Position]) -> None:
        if place in self._holding:
            self._holding.remove(place)
            self.publish(ResumedEvent(self._time))

    def _changed(self) -> None:
        told = [
            {"node": uid, "path": self._nodes[uid].path, "when": _WHEN[position], "condition": None, "once": once}
            for (uid, position), once in self._set.items()
        ]
        self.publish(BreakpointsEvent(told))
        if self._file is not None:
            kept = [[point["path"], point["when"], point["once"]] for point in told]
            self._file.write_text(json.dumps(kept, ensure_ascii=False) + "\n", encoding="utf-8")

    def _kept(self) -> list[tuple[str, Literal["before", "after"], bool]]:
        try:
            told = json.loads(self._file.read_text(encoding="utf-8")) if self._file is not None else []
            return [(str(path), when, once is True) for path, when, once in told if when in _POSITIONS]
        except FileNotFoundError:
            return []
        except (OSError, ValueError, TypeError, RecursionError) as error:
            raise Groot2Error(f"{self._file} holds no breakpoints: {error}; remove it") from error
