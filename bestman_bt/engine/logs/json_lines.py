"""State changes as JSON lines: ``{"time": 0.05, "uid": 3, "path": "arm/grasp", "from": "IDLE", "to": "RUNNING"}``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, TextIO

from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.logs.stamped import TransitionLog
from bestman_bt.engine.status import STATUS_NAMES
from bestman_bt.engine.tree import StateChanges, Tree


class JsonLinesWriter(TransitionLog):
    """Writes one line a state change; ``time`` in seconds of the tree's clock."""

    def __init__(self, tree: Tree, path: str | Path) -> None:
        super().__init__(tree)
        self.path = Path(path)
        self._file: TextIO | None = None

    def _begin(self) -> None:
        self._file = self.path.open("w", encoding="utf-8")

    def _end(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _listen(self, changes: StateChanges) -> None:
        if self._file is None:
            return
        nodes = self._tree.nodes
        for uid, previous, state in self._with_previous(changes):
            record = {
                "time": changes.stamp,
                "uid": uid,
                "path": nodes[uid - 1].path,
                "from": STATUS_NAMES[previous],
                "to": STATUS_NAMES[state],
            }
            self._file.write(json.dumps(record) + "\n")


def read_json_lines(path: str | Path) -> list[dict[str, Any]]:
    """Return the records of a file.

    Raises:
        EngineError: a line is not a record.
    """
    records = []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8").splitlines(), 1):
        try:
            records.append(json.loads(line))
        except ValueError as error:
            raise EngineError(f"{path}:{number}: not a JSON record: {error}") from error
    return records
