"""State changes as a Chrome trace: opens in Perfetto (https://ui.perfetto.dev) or chrome://tracing.

Format: "Trace Event Format", duration events (``ph`` B and E), times in microseconds, a row per node.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TextIO

from bestman_bt.engine.logs.stamped import TransitionLog
from bestman_bt.engine.status import FAILURE, RUNNING, STATUS_NAMES, SUCCESS
from bestman_bt.engine.tree import StateChanges, Tree


class ChromeTraceWriter(TransitionLog):
    """Writes a slice for each time that a node was RUNNING, and an instant for each result that took no time."""

    def __init__(self, tree: Tree, path: str | Path) -> None:
        super().__init__(tree)
        self.path = Path(path)
        self._file: TextIO | None = None
        self._separator = ""

    def _begin(self) -> None:
        self._file = self.path.open("w", encoding="utf-8")
        self._separator = ""
        self._file.write("[")
        for node in self._tree.nodes:
            self._write({"ph": "M", "name": "thread_name", "tid": node.uid, "args": {"name": node.path}})
            self._write({"ph": "M", "name": "thread_sort_index", "tid": node.uid, "args": {"sort_index": node.uid}})
            if node.state == RUNNING:
                self._slice("B", node.uid, self._tree.clock.now())

    def _end(self) -> None:
        if self._file is None:
            return
        for uid, state in self._states.items():
            if state == RUNNING:
                self._slice("E", uid, self._tree.clock.now())
        self._file.write("]\n")
        self._file.close()
        self._file = None

    def _write(self, event: dict[str, object]) -> None:
        if self._file is not None:
            self._file.write(self._separator + json.dumps({"pid": 1, **event}))
            self._separator = ",\n"

    def _slice(self, phase: str, uid: int, stamp: float, result: str = "") -> None:
        node = self._tree.nodes[uid - 1]
        event: dict[str, object] = {"ph": phase, "name": node.name, "cat": node.type_id, "tid": uid, "ts": stamp * 1e6}
        if result:
            event["args"] = {"result": result}
        self._write(event)

    def _listen(self, changes: StateChanges) -> None:
        for uid, previous, state in self._with_previous(changes):
            if state == RUNNING:
                self._slice("B", uid, changes.stamp)
            elif previous == RUNNING:
                self._slice("E", uid, changes.stamp, STATUS_NAMES[state])
            elif state in (SUCCESS, FAILURE):
                node = self._tree.nodes[uid - 1]
                self._write(
                    {
                        "ph": "i",
                        "s": "t",
                        "name": STATUS_NAMES[state],
                        "cat": node.type_id,
                        "tid": uid,
                        "ts": changes.stamp * 1e6,
                    }
                )
