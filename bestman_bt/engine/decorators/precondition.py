"""Decorators that decide whether the child is ticked: by a script, or by the update of an entry."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from bestman_bt.engine.core.ports import In, key_of
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS, NodeStatus


class Precondition(Decorator):
    """Ticks its child if the script ``if`` is true, else returns ``else``; not evaluated while the child is running."""

    if_ = In(str, "the script that decides", port="if")
    else_ = In(
        NodeStatus, "Return status if condition is false", default=NodeStatus.FAILURE, required=True, port="else"
    )
    RESETS_CHILD = True

    holds: Callable[[], bool]

    def on_load(self) -> None:
        """Compile the script, unless it comes from the blackboard."""
        self.source: str | None = None
        self.entered = False
        self.is_literal = key_of(self.attributes["if"], "if") is None
        if self.is_literal:
            self._compile()

    def _compile(self) -> None:
        source = self.if_
        if source != self.source:
            self.holds = self.owner.compiler.compile_condition(source, self.board)
            self.source = source

    def on_tick(self) -> int:
        """Evaluate the script and tick the child if the result is true."""
        if not self.is_literal:
            self._compile()
        otherwise = int(self.else_)
        if not self.entered:
            self.entered = self.holds()
        if not self.entered:
            return otherwise
        status = self.child.execute_tick()
        if status in (SUCCESS, FAILURE):
            self.reset_child()
            self.entered = False
        return status


class _WhenUpdated(Decorator):
    entry = In(Any, "Entry to check")
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
