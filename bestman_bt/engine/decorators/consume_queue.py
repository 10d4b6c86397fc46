"""ConsumeQueue: the older form of Loop, over a shared queue."""

from __future__ import annotations

from collections import deque
from typing import Any

from py_trees.ports import PortInformation

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, RUNNING, SUCCESS


class ConsumeQueue(Decorator):
    """Takes items from the ``deque`` at ``queue`` and ticks the child for each, several in one tick; fails with it."""

    INPUT_PORTS = {"queue": PortInformation(deque, False, "a collections.deque, emptied in place")}
    OUTPUT_PORTS = {"popped_item": PortInformation(Any, False, "the current item")}
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Begin with an idle child."""
        self.child_runs = False

    def halt(self) -> None:
        """Halt the child."""
        self.child_runs = False
        super().halt()

    def on_tick(self) -> int:
        """Finish the current item, then take the others until the child runs or fails."""
        result = SUCCESS
        if self.child_runs:
            result = self._tick_child()
            if result in (RUNNING, FAILURE):
                return result
        queue = self.get_input("queue")
        while queue:
            self.set_state(RUNNING)
            self.set_output("popped_item", queue.popleft())
            status = self._tick_child()
            if status in (RUNNING, FAILURE):
                return status
            result = status
        return result

    def _tick_child(self) -> int:
        status = self.child.execute_tick()
        self.child_runs = status == RUNNING
        if status != RUNNING:
            self.reset_child()
        return status
