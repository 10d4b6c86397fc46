"""RunOnce: the child is executed only once."""

from __future__ import annotations

from py_trees.ports import PortInformation

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


class RunOnce(Decorator):
    """Ticks its child until it is done, once; then SKIPPED, or the same result with ``then_skip="false"``."""

    INPUT_PORTS = {
        "then_skip": PortInformation(
            bool,
            False,
            "If true, skip after the first execution, otherwise return the same NodeStatus returned once by the child.",
            True,
        )
    }
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Begin not done."""
        self.result: int | None = None

    def on_tick(self) -> int:
        """Tick the child unless it is done."""
        if self.result is not None:
            return SKIPPED if self.get_input("then_skip") else self.result
        self.set_state(RUNNING)
        status = self.child.execute_tick()
        if status in (SUCCESS, FAILURE):
            self.result = status
            self.reset_child()
        return status
