"""SetBlackboard, UnsetBlackboard, WasEntryUpdated, PopFromQueue and QueueSize."""

from __future__ import annotations

from collections import deque
from typing import Any

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import In, InOut, Out, key_of
from bestman_bt.engine.errors import BlackboardError
from bestman_bt.engine.leaves.base import SyncAction
from bestman_bt.engine.status import FAILURE, SUCCESS


class SetBlackboard(SyncAction):
    """Writes ``value``, a literal or a copy of an entry, to the entry named by ``output_key``."""

    CHECKED_AT_TICK = True
    value = In(Any, "Value to be written into the output_key")
    output_key = InOut(Any, "Name of the blackboard entry where the value should be written")

    def on_tick(self) -> int:
        """Copy the value. Raises NodeError if ``value`` or ``output_key`` is missing; FAILURE if the entry is empty."""
        value = self.attributes.get("value")
        if value is None:
            raise self.error("port 'value' is required but not given")
        target = self.board.slot(str(self.output_key))
        source_key = key_of(value, "value")
        if source_key is not None:
            source = self.board.slot(source_key)
            if not source.exists:
                raise self.error(f"port 'value': there is no entry '{source_key}'")
            value = source.value
            if not target.exists:
                target.exists = True
                target.kind = source.kind
        elif not target.exists and value is not None:
            target.kind = type(value)
        if value is None:
            return FAILURE
        try:
            if target.kind is None:
                target.write(value, self)
            else:
                target.assign(value, self)
        except BlackboardError as error:
            raise self.error(f"port 'output_key': {error}") from error
        return SUCCESS


class UnsetBlackboard(SyncAction):
    """Removes the entry named by ``key`` from the SubTree's own blackboard."""

    CHECKED_AT_TICK = True
    key = In(str, "Key of the entry to remove")

    def on_tick(self) -> int:
        """Remove the entry, if any."""
        self.board.unset(self.key)
        return SUCCESS


def names_entry(cls: type[Node], port: str) -> bool:
    """Return whether a literal in this port of a node class names an entry."""
    return port in ("output_key", "key") and issubclass(cls, (SetBlackboard, UnsetBlackboard))


class WasEntryUpdated(SyncAction):
    """SUCCESS if ``entry`` was written since the last tick, else FAILURE."""

    entry = In(Any, "Entry to check")

    def on_load(self) -> None:
        """Find the entry."""
        entry = self.attributes["entry"]
        self.slot = self.board.slot(key_of(entry, "entry") or entry)
        self.seen = 0

    def on_tick(self) -> int:
        """Compare the sequence number with the last one seen."""
        if not self.slot.exists:
            return FAILURE
        seen, self.seen = self.seen, self.slot.sequence
        return SUCCESS if seen != self.seen else FAILURE


class PopFromQueue(SyncAction):
    """Takes the first item of the ``deque`` at ``queue``; FAILURE if it is empty."""

    queue = In(deque, "a collections.deque, emptied in place", required=False)
    popped_item = Out(Any, "the item")

    def on_tick(self) -> int:
        """Pop an item."""
        queue = self.queue
        if not queue:
            return FAILURE
        self.popped_item = queue.popleft()
        return SUCCESS


class QueueSize(SyncAction):
    """Writes the number of items of the ``deque`` at ``queue``; FAILURE if it is empty."""

    queue = In(deque, "a collections.deque", required=False)
    size = Out(int, "the number of items")

    def on_tick(self) -> int:
        """Write the number of items."""
        queue = self.queue
        if not queue:
            return FAILURE
        self.size = len(queue)
        return SUCCESS
