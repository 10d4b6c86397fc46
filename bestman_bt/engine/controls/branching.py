"""IfThenElse and WhileDoElse: a first child decides which of the others is ticked."""

from __future__ import annotations

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


class IfThenElse(Control, composites.Selector):
    """Asks the first child once; ticks the second if it succeeded, else the third (FAILURE without one)."""

    MIN_CHILDREN = 2
    MAX_CHILDREN = 3
    CHECKED_AT_TICK = True

    def on_load(self) -> None:
        """Begin with the condition."""
        self.index = 0

    def halt(self) -> None:
        """Forget the branch."""
        self.index = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the condition, then the branch that it chose."""
        children = self.nodes_below()
        if not 2 <= len(children) <= 3:
            raise self.error(f"it must have 2 or 3 children but has {len(children)}")
        self.set_state(RUNNING)
        if self.index == 0:
            status = children[0].execute_tick()
            if status == RUNNING:
                return RUNNING
            if status == SKIPPED:
                raise self.error("its condition was SKIPPED; it must succeed or fail")
            if status == SUCCESS:
                self.index = 1
            elif len(children) == 3:
                self.index = 2
            else:
                return status
        status = children[self.index].execute_tick()
        if status == RUNNING:
            return RUNNING
        self.reset_children()
        self.index = 0
        return status


class WhileDoElse(Control, composites.Selector):
    """Asks the first child at every tick; ticks the second while it succeeds, else the third, halting the other."""

    MIN_CHILDREN = 2
    MAX_CHILDREN = 3
    CHECKED_AT_TICK = True

    def on_tick(self) -> int:
        """Tick the condition, then the branch that it chooses now."""
        children = self.nodes_below()
        if not 2 <= len(children) <= 3:
            raise self.error(f"it must have 2 or 3 children but has {len(children)}")
        self.set_state(RUNNING)
        condition = children[0].execute_tick()
        if condition == RUNNING:
            return RUNNING
        if condition == SKIPPED:
            self.reset_children()
            raise self.error("its condition was SKIPPED; it must succeed or fail")
        if condition == SUCCESS:
            if len(children) == 3:
                self.halt_child(children[2])
            status = children[1].execute_tick()
        elif len(children) == 3:
            self.halt_child(children[1])
            status = children[2].execute_tick()
        else:
            status = FAILURE
        if status != RUNNING:
            self.reset_children()
        return status
