"""PipelineSequence, RoundRobin and RecoveryNode of Nav2 (nav2_behavior_tree/plugins/control)."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge
from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.core.ports import In
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


class PipelineSequence(Control, composites.Sequence):
    """Ticks its children in order at every tick, up to the furthest one reached so far.

    A running child does not block later children that have been started already.
    """

    def on_load(self) -> None:
        """Set the first child as the current one."""
        self.furthest = 0

    def halt(self) -> None:
        """Reset the progress."""
        self.furthest = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the children reached so far, and the next one."""
        self.set_state(RUNNING)
        children = self.nodes_below()
        skipped = 0
        for index, child in enumerate(children):
            status = child.execute_tick()
            if status == FAILURE:
                self.reset_children()
                self.furthest = 0
                return FAILURE
            if status == RUNNING and index >= self.furthest:
                self.furthest = index
                return RUNNING
            skipped += status == SKIPPED
        self.reset_children()
        self.furthest = 0
        return SKIPPED if skipped == len(children) else SUCCESS


class RoundRobin(Control, composites.Selector):
    """Ticks its children in turn until one succeeds, and continues with the next child at the next tick.

    After the last child it starts over; without ``wrap_around`` it fails there once before it starts over.
    """

    wrap_around = In(bool, "Whether to continue with the first child after the last one", default=True)

    def on_load(self) -> None:
        """Set the first child as the current one."""
        self.index = 0
        self.failed = 0

    def halt(self) -> None:
        """Return to the first child."""
        self.index = 0
        self.failed = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the current child, then the following ones while they fail."""
        children = self.nodes_below()
        wraps = self.wrap_around
        self.set_state(RUNNING)
        skipped = 0
        while self.failed + skipped < len(children):
            if self.index == len(children):
                if not wraps:
                    break
                self.index = 0
            status = children[self.index].execute_tick()
            if status == RUNNING:
                return RUNNING
            self.index += 1
            if status == SUCCESS:
                self.failed = 0
                self.reset_children()
                return SUCCESS
            if status == FAILURE:
                self.failed += 1
            else:
                skipped += 1
        self.reset_children()
        self.index = 0
        self.failed = 0
        return SKIPPED if skipped == len(children) else FAILURE


class RecoveryNode(Control, composites.Selector):
    """Ticks the first child; when it fails, ticks the second and tries the first again, ``number_of_retries`` times."""

    MIN_CHILDREN = 2
    MAX_CHILDREN = 2
    number_of_retries = In[int](Annotated[int, Ge(0)], "Number of retries", default=1)

    def on_load(self) -> None:
        """Set the first child as the current one."""
        self._clear()

    def _clear(self) -> None:
        self.recovering = False
        self.retries = 0

    def halt(self) -> None:
        """Reset the retries."""
        self._clear()
        super().halt()

    def on_tick(self) -> int:
        """Tick the action, or the recovery."""
        action, recovery = self.nodes_below()
        allowed = self.number_of_retries
        if self._s != RUNNING:
            self.set_state(RUNNING)
        while True:
            if not self.recovering:
                status = action.execute_tick()
                if status == RUNNING:
                    return RUNNING
                if status != FAILURE or self.retries >= allowed:
                    return self._end(status)
                self.halt_child(action)
                self.recovering = True
            status = recovery.execute_tick()
            if status == RUNNING:
                return RUNNING
            if status != SUCCESS:
                return self._end(FAILURE)
            self.halt_child(recovery)
            self.retries += 1
            self.recovering = False
            self.owner.publish()  # the action's failure, before the next attempt says something else

    def _end(self, status: int) -> int:
        self.reset_children()
        self._clear()
        return status
