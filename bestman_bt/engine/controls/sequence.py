"""Sequence, AsyncSequence and SequenceWithMemory: children in order, until one fails."""

from __future__ import annotations

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.controls.indexed import Indexed, indexed_tick_bare, indexed_tick_traced
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS

# IfThenElse and WhileDoElse: a first child decides which of the others is ticked.


class IfThenElse(Control, composites.Selector):
    """Ticks the first child once, then the second if it succeeded, else the third (FAILURE without one)."""

    MIN_CHILDREN = 2
    MAX_CHILDREN = 3
    CHECKED_AT_TICK = True

    def on_load(self) -> None:
        """Set the condition as the current child."""
        self.index = 0

    def halt(self) -> None:
        """Forget the chosen branch."""
        self.index = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the condition, then the chosen branch."""
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
    """Ticks the first child at every tick; the second while it succeeds, else the third; the other one is halted."""

    MIN_CHILDREN = 2
    MAX_CHILDREN = 3
    CHECKED_AT_TICK = True

    def on_tick(self) -> int:
        """Tick the condition, then the branch that it selects."""
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


# Fallback and AsyncFallback: children in order, until one succeeds.


class Fallback(Indexed, composites.Selector):
    """Ticks its children in order; SUCCESS as soon as one succeeds, FAILURE when all failed.

    A running child is resumed at the next tick; children that failed before it are not ticked again.
    """

    GO, STOP = FAILURE, SUCCESS
    tick_bare = indexed_tick_bare(FAILURE, SUCCESS)
    tick_traced = indexed_tick_traced(FAILURE, SUCCESS)


class AsyncFallback(Indexed, composites.Selector):
    """A Fallback that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    GO, STOP = FAILURE, SUCCESS
    YIELDS = True


class Sequence(Indexed, composites.Sequence):
    """Ticks its children in order; SUCCESS when all succeeded, FAILURE as soon as one fails.

    A running child is resumed at the next tick; the children before it are not ticked again.
    """

    GO, STOP = SUCCESS, FAILURE
    tick_bare = indexed_tick_bare(SUCCESS, FAILURE)
    tick_traced = indexed_tick_traced(SUCCESS, FAILURE)


class AsyncSequence(Indexed, composites.Sequence):
    """A Sequence that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    GO, STOP = SUCCESS, FAILURE
    YIELDS = True


class SequenceWithMemory(Indexed, composites.Sequence):
    """A Sequence that resumes at the failed child, even after a halt; it yields like AsyncSequence."""

    GO, STOP = SUCCESS, FAILURE
    YIELDS = True
    RESETS_ON_HALT = False


__all__ = ["AsyncSequence", "Control", "Sequence", "SequenceWithMemory"]
