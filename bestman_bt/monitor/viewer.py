"""One open page: handles its requests and sends changes, at most 30 times a second and never faster than it reads.

First it gets the full state of a run, then changes, or the state at another time.
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
import time
from collections.abc import Awaitable, Callable
from dataclasses import asdict
from importlib.metadata import version
from itertools import islice, repeat, zip_longest
from typing import Any

import numpy as np
from pydantic_core import PydanticSerializationError, to_json

from bestman_bt.engine.logs.btlog import Transition
from bestman_bt.engine.status import FAILURE, STATUS_NAMES, SUCCESS
from bestman_bt.monitor.controls import CONTROLS, control
from bestman_bt.monitor.run import MonitoredRun, RunError
from bestman_bt.monitor.run_list import RunList
from bestman_bt.records.events import MAIN_TREE
from bestman_bt.records.history import Picture, RunHistory
from bestman_bt.records.timeline import outcomes

MAX_OUTCOMES = 100_000
"""Largest number of outcomes to compare."""


def compare(a: RunHistory, b: RunHistory) -> dict[str, Any]:
    """Compare two runs; returns ``parted`` (None if they never differ) and ``words``.

    The outcomes of the leaves are compared in order, not their times: runs that differ only in speed count as equal.
    Leaves are identified by path.
    """
    common = 0
    for mine, other in zip_longest(_story(a), _story(b)):
        if _key(a, mine) != _key(b, other):
            return _parted(a, b, mine, other, common)
        common += 1
    if not common:
        return {"parted": None, "words": "no leaf has returned anything in either of them"}
    return {"parted": None, "words": f"the same {common} outcomes of leaves in the same order"}


def _story(history: RunHistory) -> list[Transition]:
    """Return the messages of leaves that ended."""
    told = outcomes(history.states.changes())
    return list(islice((one for one in told if history.nodes.node(one.uid).is_leaf), MAX_OUTCOMES))


def _key(history: RunHistory, outcome: Transition | None) -> tuple[str, int] | None:
    return None if outcome is None else (history.nodes.path_of(outcome.uid), outcome.status)


def _parted(
    a: RunHistory, b: RunHistory, mine: Transition | None, other: Transition | None, common: int
) -> dict[str, Any]:
    words = [f"after {common} equal outcomes of leaves: " if common else "from the beginning: "]
    words.append(f"in A {_words(a, mine)}; in B {_words(b, other)}")
    first = mine if mine is not None else other
    owner = a if mine is not None else b
    parted = {
        "time_a": mine.time if mine is not None else a.last,
        "time_b": other.time if other is not None else b.last,
        "path": owner.nodes.path_of(first.uid) if first is not None else "",
        "state_a": mine.status if mine is not None else None,
        "state_b": other.status if other is not None else None,
        "path_b": b.nodes.path_of(other.uid) if other is not None else None,
        "words": "".join(words),
    }
    return {"parted": parted, "words": parted["words"]}


def _words(history: RunHistory, outcome: Transition | None) -> str:
    if outcome is None:
        return "no leaf returned anything more"
    result = {SUCCESS: "succeeded", FAILURE: "failed"}.get(outcome.status, STATUS_NAMES[outcome.status])
    told = f"'{history.nodes.path_of(outcome.uid)}' {result} at {outcome.time:.2f} s"
    message = history.message_at(outcome.uid, outcome.time)
    return f"{told} ({message})" if message else told


PERIOD = 1 / 30
"""Seconds between two sendings."""
IDLE_PERIOD = 1.0
"""Seconds until the next check, even without a notification."""
MOST_OPEN = 8
MOST_WAITING = 64
"""Largest number of pending requests and answers; beyond it no request is read."""
MOST_CONTROLS = 16
"""Largest number of unanswered controls of an executor; a stop is always forwarded."""
REQUESTS_A_SECOND = 200
"""Average rate of requests per page; beyond it requests are delayed."""

_LOG = logging.getLogger(__name__)


class Viewer:
    """A connected page. ``send`` and ``receive`` exchange texts; ``run`` returns when either side has disconnected."""

    def __init__(
        self,
        runs: RunList,
        send: Callable[[str], Awaitable[None]],
        receive: Callable[[], Awaitable[str]],
        read_only: bool,
    ) -> None:
        self._runs = runs
        self._send = send
        self._receive = receive
        self._read_only = read_only
        self._open: dict[str, Updates] = {}
        self._wake = asyncio.Event()
        self._answers: asyncio.Queue[Message] = asyncio.Queue(MOST_WAITING)
        self._asked: asyncio.Queue[Message] = asyncio.Queue(MOST_WAITING)
        self._controls: set[asyncio.Task[None]] = set()
        self._runs_version = -1

    async def run(self) -> None:
        """Serve until the connection ends. Raises the error that ended it, unless the peer closed the connection."""
        self._runs.watchers.add(self._wake)
        await self._send_message(
            {"type": "hello", "version": version("bestman-bt"), "read_only": self._read_only} | self._list()
        )
        tasks = [asyncio.create_task(work()) for work in (self._write, self._read, self._work)]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in (*tasks, *self._controls):
                task.cancel()
            await asyncio.gather(*tasks, *self._controls, return_exceptions=True)
            self._runs.watchers.discard(self._wake)
            for identity in list(self._open):
                self._close(identity)

    async def _write(self) -> None:
        while True:
            while not self._answers.empty():
                await self._send_message(self._answers.get_nowait())
            if self._runs_version != self._runs.version:
                await self._send_message({"type": "runs"} | self._list())
            for updates in list(self._open.values()):
                for message in self._news(updates):
                    await self._send_message(message)
            await asyncio.sleep(PERIOD)
            try:
                async with asyncio.timeout(IDLE_PERIOD):
                    await self._wake.wait()
            except TimeoutError:
                continue
            self._wake.clear()

    def _news(self, updates: Updates) -> list[Message]:
        try:
            return updates.messages(time.monotonic())
        except Exception as error:  # noqa: BLE001 - a run that cannot be told is closed, not the page with all others
            self._close(updates.run.id)
            return [{"type": "problem", "message": _unexpected(error)}]

    def _list(self) -> Message:
        self._runs_version = self._runs.version
        return {"runs": self._runs.summaries()}

    async def _send_message(self, message: Message) -> None:
        await self._send(encoded(message))

    async def _read(self) -> None:
        allowance, since = float(REQUESTS_A_SECOND), time.monotonic()
        while True:
            text = await self._receive()
            now = time.monotonic()
            allowance = min(REQUESTS_A_SECOND, allowance + (now - since) * REQUESTS_A_SECOND) - 1
            since = now
            if allowance < 0:
                await asyncio.sleep(-allowance / REQUESTS_A_SECOND)
            asked = _parsed(text)
            what = asked.get("do")
            if what == "stop" or (what in CONTROLS and len(self._controls) < MOST_CONTROLS):
                task = asyncio.create_task(self._answer(asked))  # a stop waits for nothing that was asked before
                self._controls.add(task)
                task.add_done_callback(self._controls.discard)
            else:
                await self._asked.put(asked)

    async def _work(self) -> None:
        """Carry out, one after the other, requests that only change which data the page receives."""
        while True:
            await self._answer(await self._asked.get())

    async def _answer(self, asked: Message) -> None:
        await self._answers.put(await self._answered(asked))
        self._wake.set()

    async def _answered(self, asked: Message) -> Message:
        """Execute one request. Returns the answer to send."""
        number = asked.get("n")
        number = number if isinstance(number, int | str) else None
        try:
            answer = await self._carried_out(asked)
        except RunError as error:
            why = str(error)
        except Exception as error:  # noqa: BLE001 - whatever one request meets, the page goes on
            why = _unexpected(error)
        else:
            return answer if answer is not None else {"type": "answer", "for": number, "ok": True}
        if number is None:
            return {"type": "problem", "message": why}
        return {"type": "answer", "for": number, "ok": False, "error": why}

    async def _control(self, run: MonitoredRun, asked: Message) -> None:
        if self._read_only:
            raise RunError("this monitor was started with --read-only: it only shows")
        await control(run, asked)

    async def _carried_out(self, asked: Message) -> Message | None:
        what = asked.get("do")
        if what is None:
            raise RunError('a request should be one JSON object with "do"')
        if what == "compare":
            return await self._compare(asked.get("ids"))
        run = self._run(asked.get("id"))
        match what:
            case "open":
                await self._open_run(run)
            case "close":
                self._close(run.id)
            case "seek":
                self._opened(run).look_at(_seconds(asked.get("time")))
            case "live":
                self._opened(run).look_at(None)
            case "timeline":
                return self._timeline(run)
            case "series":
                return {"type": "series", "id": run.id, "joints": run.history.robot.series(_names(run, asked))}
            case str() if what in CONTROLS:
                await self._control(run, asked)
            case _:
                raise RunError(f"unknown request {str(what)[:40]!r}")
        return None

    async def _open_run(self, run: MonitoredRun) -> None:
        if run.id not in self._open and len(self._open) >= MOST_OPEN:
            raise RunError(f"at most {MOST_OPEN} runs can be open at a time")
        run.watchers.add(self._wake)
        try:
            await run.open()
        except RunError:
            run.watchers.discard(self._wake)
            raise
        self._open[run.id] = Updates(run)

    def _close(self, identity: str) -> None:
        updates = self._open.pop(identity, None)
        if updates is not None:
            updates.run.watchers.discard(self._wake)

    def _timeline(self, run: MonitoredRun) -> Message:
        history = run.history
        extent = {"first": history.states.first, "last": history.last}
        return {"type": "timeline", "id": run.id} | extent | history.timeline.document(history.last)

    async def _compare(self, identities: Any) -> Message:
        if not isinstance(identities, list) or len(identities) != 2:
            raise RunError("compare requires two ids")
        one, other = (self._run(identity) for identity in identities)
        for run in (one, other):
            await run.open()
        return {"type": "comparison", "ids": [one.id, other.id]} | compare(one.history, other.history)

    def _run(self, identity: Any) -> MonitoredRun:
        run = self._runs.get(identity) if isinstance(identity, str) else None
        if run is None:
            raise RunError(f"there is no run {str(identity)[:80]!r}")
        return run

    def _opened(self, run: MonitoredRun) -> Updates:
        if run.id not in self._open:
            raise RunError(f"the run {run.id!r} is not open")
        return self._open[run.id]


def _parsed(text: str) -> Message:
    """Return the request, or an empty one if the message is not a request."""
    try:
        asked = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return asked if isinstance(asked, dict) and isinstance(asked.get("do"), str) else {}


def _unexpected(error: Exception) -> str:
    _LOG.error("a request of a page failed", exc_info=error)
    return f"the monitor met what it did not expect: {error!r}"[:500]


def _seconds(value: Any) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        raise RunError("time is a number of seconds")
    return float(value)


def _names(run: MonitoredRun, asked: Message) -> list[str]:
    names = asked.get("joints")
    if names is None:
        return run.history.robot.joint_names()
    if not isinstance(names, list) or len(names) > 100 or not all(isinstance(name, str) for name in names):
        raise RunError("joints should be a list of names")
    return names


def encoded(message: Message) -> str:
    """Encode a message as JSON for browsers: NaN and infinities become null."""
    try:
        return to_json(message, inf_nan_mode="null").decode()
    except PydanticSerializationError:  # half a character, as in the name of a folder that is not UTF-8
        return json.dumps(_finite(message), allow_nan=False, separators=(",", ":"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


STATISTICS_PERIOD = 0.5
EXTENT_PERIOD = 1.0
"""Seconds between two messages with the counts, and with the progress of a run while its past is shown."""
FIRST_LINES = 500
MOST_LINES = 2_000
"""Largest number of log lines in one message: the newest ones."""
Message = dict[str, Any]


class Updates:
    """One run for one viewer. ``messages`` returns the due messages; nothing accumulates without calls."""

    def __init__(self, run: MonitoredRun) -> None:
        self.run = run
        self._at: float | None = None if run.is_live else 0.0  # the time that is looked at; None: now
        self._must_tell_all = True
        self._tree_version = -1
        self._version = -1
        self._log_version = -1
        self._picture = 0
        self._statistics_version = -1
        self._statistics_due = 0.0
        self._extent_due = 0.0
        self._extent = -1.0
        self._running: list[int] = []

    def look_at(self, time: float | None) -> None:
        """Show the state at ``time`` from now on; None: the current state."""
        self._at = time
        self._must_tell_all = True

    def messages(self, now: float) -> list[Message]:
        """Return the messages to send. ``now``: seconds of any clock."""
        history, messages = self.run.history, []
        if self._tree_version != history.tree_version:
            self._tree_version = history.tree_version
            messages.append(self._tree())
        if self._must_tell_all:
            self._must_tell_all = False
            messages += self._all()
        elif self._at is None:
            if self._version != history.version or self._owes_statistics(now):
                messages.append(self._delta(now))
                messages += [self._image(picture) for picture in history.pictures if picture.number > self._picture]
                self._picture = history.pictures[-1].number if history.pictures else 0
        elif self._extent != history.last and now >= self._extent_due:
            self._extent, self._extent_due = history.last, now + EXTENT_PERIOD
            messages.append({"type": "extent", "id": self.run.id, "first": history.states.first, "last": history.last})
        messages += self._log()
        return messages

    def _tree(self) -> Message:
        history = self.run.history
        return {
            "type": "tree",
            "id": self.run.id,
            "nodes": [asdict(node) for node in history.nodes],
            "duration": history.last,
            "first": history.states.first,
            "last": history.last,
            "map": history.map,
            "scopes": sorted({node.scope for node in history.nodes}),
        }

    def _all(self) -> list[Message]:
        """Return the full state, now or at the time that is looked at."""
        history = self.run.history
        time = history.last if self._at is None else min(max(self._at, history.states.first), history.last)
        is_now = self._at is None
        nodes, tick = history.states.now, history.tick
        if not is_now:
            moment = history.states.at(time)
            nodes, tick = moment.nodes, moment.tick
        self._version = history.version
        self._running = nodes.running()
        self._picture = history.pictures[-1].number if history.pictures else 0
        path = history.paths.at(time)
        state: Message = {
            "type": "state",
            "id": self.run.id,
            "time": time,
            "tick": tick,
            "live": is_now and self.run.is_live,
            "first": history.states.first,
            "last": history.last,
            "states": {"0": nodes.states[1:].tolist()},
            "results": {"0": nodes.results[1:].tolist()},
            "messages": history.messages_at(time),
            "statistics": nodes.statistics(np.arange(1, len(nodes) + 1), time),
            "blackboard": history.blackboard_at(time),
            "robot": history.robot.at(time),
            "scan": history.robot.scan_at(time),
            "path": path[1] if path is not None else None,
            "driven": history.robot.driven(time),
            "running": self._running,
            "paused": history.paused if is_now else None,
            "breakpoints": history.breakpoints,
        }
        return [state, *(self._image(picture) for picture in history.pictures_at(time))]

    def _statistics(self, now: float) -> Any:
        """Return statistics of running nodes, and of nodes that changed since the last update."""
        history = self.run.history
        uids = np.union1d(history.changed_nodes(self._statistics_version), self._running)
        self._statistics_version, self._statistics_due = history.version, now + STATISTICS_PERIOD
        return history.states.now.statistics(uids, history.last)

    def _delta(self, now: float) -> Message:
        history, since = self.run.history, self._version
        nodes, time = history.states.now, history.last
        changed = history.changed_nodes(since)
        states, results = nodes.states[changed].tolist(), nodes.results[changed].tolist()
        delta: Message = {
            "type": "delta",
            "id": self.run.id,
            "time": time,
            "tick": history.tick,
            "changes": list(zip(changed.tolist(), states, repeat(MAIN_TREE), results, strict=False)),
        }
        said = history.changed_messages.since(since)
        if said:
            delta["messages"] = {str(uid): history.message_at(uid, time) for uid in said}
        if len(changed) and (running := nodes.running()) != self._running:
            self._running = delta["running"] = running
        if now >= self._statistics_due and (statistics := self._statistics(now)):
            delta["statistics"] = statistics
        boards: dict[str, dict[str, Any]] = {}
        for scope, key in history.changed_entries.since(since):
            boards.setdefault(scope, {})[key] = history.entry_at(scope, key, time)
        if boards:
            delta["blackboard"] = boards
        self._version = history.version
        return delta | _changed_robot(history, since)

    def _log(self) -> list[Message]:
        history, is_first = self.run.history, self._log_version < 0
        lines = history.lines_since(self._log_version, FIRST_LINES if is_first else MOST_LINES)
        self._log_version = history.version
        if not lines and not is_first:
            return []
        return [{"type": "log", "id": self.run.id, "lines": lines} | ({"reset": True} if is_first else {})]

    def _owes_statistics(self, now: float) -> bool:
        return now >= self._statistics_due and self._statistics_version < self.run.history.version

    def _image(self, picture: Picture) -> Message:
        url = f"/runs/{self.run.id}/images/{picture.number}.jpg"
        return {"type": "image", "id": self.run.id, "camera": picture.camera, "time": picture.time, "url": url}


def _changed_robot(history: RunHistory, since: int) -> Message:
    """Return what changed after version ``since``, except the tree."""
    changes: Message = {}
    if history.robot.version > since:
        changes["robot"] = history.robot.at(history.last)
    if history.robot.scan_version > since:
        changes["scan"] = history.robot.scan_at(history.last)
    if history.path_version > since and history.paths.last is not None:
        changes["path"] = history.paths.last[1]
    if history.paused_version > since:
        changes["paused"] = history.paused
    if history.breakpoints_version > since:
        changes["breakpoints"] = history.breakpoints
    return changes
