"""The messages to one viewer of one run: the full state first, then changes, or the state at another time."""

from __future__ import annotations

from dataclasses import asdict
from itertools import repeat
from typing import Any

import numpy as np

from bestman_bt.monitor.run import MonitoredRun
from bestman_bt.records.events import MAIN_TREE
from bestman_bt.records.history import Picture, RunHistory

STATISTICS_PERIOD = 0.5
EXTENT_PERIOD = 1.0
"""Seconds between two tellings of the counts, and of how far a run has come while its past is looked at."""
FIRST_LINES = 500
MOST_LINES = 2_000
"""Log lines in one message; of more that come at once, only the newest are told."""
Message = dict[str, Any]


class Updates:
    """One run for one viewer. ``messages`` returns what is due; nothing accumulates without calls."""

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
