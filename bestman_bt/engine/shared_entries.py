"""A tree's top blackboard and py_trees' blackboard as one, for trees with native behaviours."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard as PyTreesBlackboard
from py_trees.blackboard import Client

from bestman_bt.engine.blackboard import Blackboard, Slot, TreeKey
from bestman_bt.engine.errors import BlackboardError

_MISSING: Final = object()


class SharedEntries:
    """The entry ``steps`` of the top blackboard is py_trees' key ``/steps``, ``ns/steps`` is ``/ns/steps``.

    What our nodes, scripts and those outside write reaches py_trees at once; what native behaviours have written
    becomes the entry's value with ``take_over``. A type that a port declares holds for native writers, too; others may
    change an entry's type as they like. It is made of a blackboard that is shared, once the tree's ports have declared
    their entries. The clients of ``behaviours`` lose their keys when the tree is gone: the next tree of the same kind
    may ask for exclusive access again.
    """

    def __init__(self, board: Blackboard, behaviours: Iterable[Behaviour]) -> None:
        weakref.finalize(board.store, _unregister, [behaviour.blackboards for behaviour in behaviours])
        self._board = board
        self._slots: dict[str, Slot | None] = {}
        self._typed = {slot for slot in board.slots() if slot.kind is not None}
        self.take_over()

    def take_over(self) -> None:
        """Give entries the values that py_trees' keys have.

        Raises:
            BlackboardError: a value does not fit the type that a port declares.
        """
        storage, slots = PyTreesBlackboard.storage, self._slots
        for path in storage.keys() - slots.keys():
            slots[path] = self._slot_of(path)
        for path, slot in slots.items():
            if slot is None:
                continue
            value = storage.get(path, _MISSING)
            if value is _MISSING:
                if slot.sequence:
                    slot.clear()
            elif value is not slot.value:
                slot.take(value, typed=slot in self._typed)

    def _slot_of(self, path: str) -> Slot | None:
        """The entry that is py_trees' key; None where it is one of another blackboard of a tree."""
        if isinstance(PyTreesBlackboard.metadata.get(path), TreeKey):
            return None
        try:
            return self._board.slot(path.lstrip("/"))
        except BlackboardError:  # no name of an entry
            return None


def _unregister(clients: list[list[Client]]) -> None:
    for client in (one for attached in clients for one in attached):
        with suppress(KeyError):  # somebody has cleared py_trees' blackboard
            client.unregister(clear=False)


def forget_dropped_trees() -> None:
    """Remove the keys of trees that nobody holds any more, before their behaviours are made again: values of an earlier
    run would be read, and exclusive access be refused.
    """
    if any(not isinstance(metadata, TreeKey) for metadata in PyTreesBlackboard.metadata.values()):
        gc.collect()
