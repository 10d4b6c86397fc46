"""Detection of blackboard entries of a tree that were written since the last look."""

from __future__ import annotations

from typing import Any, NamedTuple

from bestman_bt.engine import Tree
from bestman_bt.engine.blackboard import Slot
from bestman_bt.records.events import BlackboardEvent, ShownEntry
from bestman_bt.records.shown_value import REMOVED, show_value


class WrittenEntry(NamedTuple):
    """The current state of an entry; ``scope``: path of its SubTree; ``exists``: False if it was removed."""

    scope: str
    key: str
    exists: bool
    value: Any
    kind: Any


class BlackboardChanges:
    """Compares the entries' sequence numbers and stamps, so that writers are not slowed down.

    It uses both, because the sequence number of a removed entry starts again at 1.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._seen: dict[Slot, tuple[int, float] | None] = {}

    def collect(self) -> list[WrittenEntry]:
        """Return the entries written since the last call; the first call returns all entries."""
        seen, written = self._seen, []
        for scope, board in self._tree.blackboards.items():
            for slot in board.slots():
                version = (slot.sequence, slot.stamp) if slot.exists else None
                if seen.get(slot) != version:
                    seen[slot] = version
                    written.append(WrittenEntry(scope, slot.key, slot.exists, slot.value, slot.kind))
        return written


def blackboard_event(time: float, tick: int, written: list[WrittenEntry]) -> BlackboardEvent:
    """Return the event of written entries; it formats the values here, which may take time."""
    entries: dict[str, dict[str, ShownEntry]] = {}
    for entry in written:
        shown = show_value(entry.value, entry.kind) if entry.exists else REMOVED
        entries.setdefault(entry.scope, {})[entry.key] = shown
    return BlackboardEvent(time, tick, entries)
