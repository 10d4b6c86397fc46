"""A tree's top blackboard and py_trees' blackboard as one, for trees with native behaviours."""

from __future__ import annotations

from typing import Final

from py_trees.blackboard import Blackboard as PyTreesBlackboard

from bestman_bt.engine.blackboard import Blackboard, Slot, TreeKey
from bestman_bt.engine.errors import BlackboardError

_MISSING: Final = object()


class SharedEntries:
    """The entry ``steps`` of the top blackboard is py_trees' key ``/steps``, ``ns/steps`` is ``/ns/steps``.

    What our nodes, scripts and those outside write reaches py_trees at once; what native behaviours have written
    becomes the entry's value with ``take_over``. A type that a port declares holds for native writers, too; others may
    change an entry's type as they like. It is made of a blackboard that is shared, once the tree's ports have declared
    their entries.
    """

    def __init__(self, board: Blackboard) -> None:
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
