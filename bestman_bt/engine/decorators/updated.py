"""SkipUnlessUpdated and WaitValueUpdate: tick the child if an entry was written since the last time."""

from __future__ import annotations

from typing import Any, ClassVar

from py_trees.ports import PortInformation

from bestman_bt.engine.core.ports import key_of
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import RUNNING, SKIPPED


class _WhenUpdated(Decorator):
    INPUT_PORTS = {"entry": PortInformation(Any, True, "Entry to check")}
    OTHERWISE: ClassVar[int]

    def on_load(self) -> None:
        """Find the entry."""
        entry = self.attributes["entry"]
        self.slot = self.board.slot(key_of(entry, "entry") or entry)
        self.seen = 0
        self.child_runs = False

    def halt(self) -> None:
        """Halt the child."""
        self.child_runs = False
        super().halt()

    def on_tick(self) -> int:
        """Tick the child if the entry was written, or if it still runs."""
        if not self.child_runs:
            seen, self.seen = self.seen, self.slot.sequence
            if not self.slot.exists or seen == self.seen:
                return self.OTHERWISE
        status = self.child.execute_tick()
        self.child_runs = status == RUNNING
        return status


class SkipUnlessUpdated(_WhenUpdated):
    """SKIPPED unless the entry was written since the last tick."""

    OTHERWISE = SKIPPED


class WaitValueUpdate(_WhenUpdated):
    """RUNNING until the entry is written again."""

    OTHERWISE = RUNNING
