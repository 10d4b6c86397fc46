"""TryCatch: a sequence with a last child for cleanup."""

from __future__ import annotations

from py_trees import composites
from py_trees.ports import PortInformation

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class TryCatch(Control, composites.Sequence):
    """Ticks all children but the last as a sequence; when one fails, ticks the last and fails.

    With ``catch_on_halt`` the last child is also ticked, once, when the node is halted.
    """

    MIN_CHILDREN = 2
    INPUT_PORTS = {
        "catch_on_halt": PortInformation(
            bool, False, "If true, execute the catch child also when the node is halted", False
        )
    }

    def on_load(self) -> None:
        """Set the first child as the current one."""
        self._clear()

    def _clear(self) -> None:
        self.index = 0
        self.skipped = 0
        self.catching = False

    def halt(self) -> None:
        """Run the cleanup if ``catch_on_halt`` is set, then halt."""
        children = self.nodes_below()
        if self._s > IDLE and not self.catching and self.get_input("catch_on_halt"):
            for child in children[:-1]:
                self.halt_child(child)
            if children[-1].execute_tick() == RUNNING:
                self.halt_child(children[-1])
        self._clear()
        super().halt()

    def on_tick(self) -> int:
        """Tick the sequence, or the cleanup."""
        children = self.nodes_below()
        last = len(children) - 1
        if self._s <= IDLE:
            self.skipped = 0
            self.catching = False
        self.set_state(RUNNING)
        while not self.catching:
            if self.index >= last:
                all_skipped = self.skipped == last
                self.reset_children()
                self._clear()
                return SKIPPED if all_skipped else SUCCESS
            status = children[self.index].execute_tick()
            if status == RUNNING:
                return RUNNING
            if status == FAILURE:
                self.reset_children()
                self.index = 0
                self.catching = True
            else:
                self.index += 1
                self.skipped += status == SKIPPED
        if children[last].execute_tick() == RUNNING:
            return RUNNING
        self.reset_children()
        self._clear()
        return FAILURE
