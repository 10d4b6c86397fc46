"""Snapshots of a tree's blackboards: a backup in memory, and JSON to export and import."""

from __future__ import annotations

import copy
import json
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from bestman_bt.engine.blackboard import Blackboard, Slot
from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.errors import BlackboardError, ConversionError

_CONTAINERS = (list, dict, set, deque)


@dataclass(frozen=True)
class BlackboardBackup:
    """The entries of all blackboards of a tree at one moment: path → key → (value, type)."""

    boards: Mapping[str, Mapping[str, tuple[Any, Any]]]


def backup(tree: Tree) -> BlackboardBackup:
    """Return a copy of all entries; lists, dictionaries, sets and queues are copied deeply."""
    return BlackboardBackup(
        {
            path: {slot.key: (_copied(slot.value), slot.kind) for slot in board.slots() if slot.exists}
            for path, board in tree.blackboards.items()
        }
    )


def restore(tree: Tree, saved: BlackboardBackup) -> None:
    """Restore all entries; those that are not in the backup are removed.

    Raises:
        BlackboardError: the backup belongs to a tree with other SubTrees; nothing is changed.
    """
    if set(saved.boards) != set(tree.blackboards):
        raise BlackboardError(
            f"the backup has the SubTrees {sorted(saved.boards)} but the tree has {sorted(tree.blackboards)}"
        )
    for path, board in tree.blackboards.items():
        entries = saved.boards[path]
        for slot in board.slots():
            if slot.exists and slot.key not in entries:
                slot.clear()
        for key, (value, kind) in entries.items():
            slot = board.local_slot(key)
            slot.kind = kind
            slot.write(_copied(value))


def _copied(value: Any) -> Any:
    return copy.deepcopy(value) if isinstance(value, _CONTAINERS) else value


def to_json(tree: Tree) -> str:
    """Return all entries that have a value as JSON: SubTree path (the main tree: its ID) → key → value.

    Values without a JSON form become ``{"__type": name, "text": literal}``.

    Raises:
        BlackboardError: a value has neither a JSON nor a text form.
    """
    boards = {
        path or tree.tree_id: {slot.key: _json_value(slot) for slot in board.slots() if slot.value is not None}
        for path, board in tree.blackboards.items()
    }
    return json.dumps(boards, indent=2)


def _json_value(slot: Slot) -> Any:
    value = list(slot.value) if isinstance(slot.value, (deque, tuple)) else slot.value
    if type(value) in (bool, int, float, str):
        return value
    if isinstance(value, (list, dict)):
        try:
            json.dumps(value)
        except (TypeError, ValueError):
            pass
        else:
            return value
    try:
        return {"__type": type(value).__name__, "text": text_of(value)}
    except ConversionError as error:
        raise BlackboardError(f"entry '{slot.path}' cannot be exported: {error}") from error


def from_json(tree: Tree, text: str) -> None:
    """Set the entries in ``text``; others are unchanged. Values take the locked type of their entry.

    Raises:
        BlackboardError: it is not in the format of ``to_json``, names unknown SubTrees, or a value does not fit its
            entry.
    """
    try:
        data = json.loads(text)
    except ValueError as error:
        raise BlackboardError(f"the blackboards are not JSON: {error}") from error
    boards = {path or tree.tree_id: board for path, board in tree.blackboards.items()}
    if not isinstance(data, dict) or not all(isinstance(entries, dict) for entries in data.values()):
        raise BlackboardError("the blackboards must be an object of objects: SubTree path to key to value")
    unknown = sorted(set(data) - set(boards))
    if unknown:
        raise BlackboardError(f"there are no SubTrees {unknown}; the tree has {sorted(boards)}")
    for path, entries in data.items():
        for key, value in entries.items():
            _import(boards[path], key, value)


def _import(board: Blackboard, key: str, value: Any) -> None:
    slot = board.local_slot(key)
    if isinstance(value, dict) and "__type" in value:
        name = value["__type"]
        if slot.kind is None or getattr(slot.kind, "__name__", "") != name:
            raise BlackboardError(f"entry '{slot.path}' holds a {name}, which no port in the tree declares")
        value = str(value.get("text", ""))
    slot.assign(value)
