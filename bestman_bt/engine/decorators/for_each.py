"""ForEach: the child once for each item of a list of any type."""

from __future__ import annotations

from typing import Any

from py_trees.ports import PortInformation

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class ForEach(Decorator):
    """Writes the items of ``items`` to ``item`` one by one and ticks the child; FAILURE as soon as it fails.

    The list is read when the node starts; SUCCESS when all items are done, also of an empty list. Items whose
    child was SKIPPED count as done.
    """

    INPUT_PORTS = {"items": PortInformation(list[Any], True, "the items")}
    OUTPUT_PORTS = {
        "item": PortInformation(Any, False, "the current item"),
        "index": PortInformation(int, False, "its position, from 0"),
    }
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Begin before the first item."""
        self.items: list[Any] = []
        self.position = 0

    def on_tick(self) -> int:
        """Go on with the current item; between two that each took one tick, return RUNNING and wake the loop."""
        if self._s <= IDLE:
            self.items = list(self.get_input("items"))
            self.position = 0
            self.set_state(RUNNING)
        child = self.child
        while self.position < len(self.items):
            was_idle = child._s <= IDLE
            if was_idle:
                self.set_output("index", self.position)
                self.set_output("item", self.items[self.position])
            status = child.execute_tick()
            if status == RUNNING:
                return RUNNING
            self.reset_child()
            if status == FAILURE:
                return FAILURE
            self.position += 1
            if was_idle and status != SKIPPED and self.position < len(self.items):
                self.wake_up()
                return RUNNING
        return SUCCESS
