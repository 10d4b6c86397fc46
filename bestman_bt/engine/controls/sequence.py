"""Nodes that tick their children in order: sequences, fallbacks, IfThenElse, WhileDoElse, TryCatch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.core.node import Node, invalid_status_error, wrapped
from bestman_bt.engine.core.ports import In
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS


class Indexed(Control):
    """Base of controls that tick one child after the other.

    ``CONTINUE_ON``: the child status after which the next child is ticked. ``RETURN_ON``: the child status that ends
    the node and is returned.
    """

    CONTINUE_ON: ClassVar[int]
    RETURN_ON: ClassVar[int]
    YIELDS: ClassVar[bool] = False
    RESETS_ON_HALT: ClassVar[bool] = True
    index: int = 0
    skipped: int = 0

    def halt(self) -> None:
        """Reset the index, unless the node keeps it."""
        if self.RESETS_ON_HALT:
            self.index = 0
            self.skipped = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick the children, starting at the current one."""
        children = self.nodes_below()
        if self._s <= IDLE:
            self.skipped = 0
        self.set_state(RUNNING)
        while self.index < len(children):
            child = children[self.index]
            was_idle = child._s <= IDLE
            status = child.execute_tick()
            if status == RUNNING:
                return RUNNING
            if status == self.RETURN_ON:
                self._end_early()
                return status
            self.index += 1
            if status == SKIPPED:
                self.skipped += 1
            elif self.YIELDS and was_idle and self.index < len(children):
                self.wake_up()
                return RUNNING
        all_skipped = self.skipped == len(children)
        self.reset_children()
        self.index = 0
        self.skipped = 0
        return SKIPPED if all_skipped else self.CONTINUE_ON

    def rest_children(self) -> None:
        """Reset the children as ``reset_children`` does, optimised for children that have mostly finished."""
        log = self.log
        for _, child in self.pairs:
            code = child._s
            if code > RUNNING:
                if log is not None:
                    log.append(child.ev[0])
                child._s = -code
            elif code == RUNNING:
                self.halt_child(child)

    def _end_early(self) -> None:
        if self.RESETS_ON_HALT:
            self.reset_children()
            self.index = 0
        else:
            for child in self.nodes_below()[self.index :]:
                self.halt_child(child)


def indexed_tick_bare(go: int, stop: int) -> Callable[[Any], int]:  # noqa: C901 - it holds a tick, which is one function: each call in it costs
    """Return the tick function of an ``Indexed`` node without listeners."""

    def tick(self: Any) -> int:
        if self._s <= 0:
            self.skipped = 0
        self._s = RUNNING
        pairs = self.pairs
        index = self.index
        count = len(pairs)
        child = self
        try:
            while index < count:
                run, child = pairs[index]
                status = run()
                if status == RUNNING:
                    if child._s != RUNNING:
                        child.begin_running()
                    return RUNNING
                if status == go:
                    child._s = status
                    self.index = index = index + 1
                elif status == stop:
                    child._s = status
                    self.reset_children()
                    self.index = 0
                    return stop
                elif status == SKIPPED:
                    self.index = index = index + 1
                    self.skipped += 1
                else:
                    raise invalid_status_error(status, child)
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, child) from error
        all_skipped = self.skipped == count
        self.rest_children()
        self.index = self.skipped = 0
        return SKIPPED if all_skipped else go

    return tick


def indexed_tick_traced(go: int, stop: int) -> Callable[[Any], int]:  # noqa: C901 - it holds a tick, which is one function: each call in it costs
    """Return the tick function of an ``Indexed`` node that logs every state change."""

    def tick(self: Any) -> int:  # noqa: C901 - a tick is one function: each call in it costs
        log = self.log
        if self._s <= 0:
            self.skipped = 0
        if self._s != RUNNING:
            self._s = RUNNING
            log.append(self.ev[1])
        pairs = self.pairs
        index = self.index
        count = len(pairs)
        child = self
        try:
            while index < count:
                run, child = pairs[index]
                status = run()
                if status != SKIPPED and child._s != status:
                    _note_change(child, status, log)
                if status == RUNNING:
                    return RUNNING
                if status == go:
                    self.index = index = index + 1
                elif status == stop:
                    self.reset_children()
                    self.index = 0
                    return stop
                elif status == SKIPPED:
                    self.index = index = index + 1
                    self.skipped += 1
                else:
                    raise invalid_status_error(status, child)
        except NodeError:
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            raise wrapped(error, child) from error
        all_skipped = self.skipped == count
        self.rest_children()
        self.index = self.skipped = 0
        return SKIPPED if all_skipped else go

    return tick


def _note_change(child: Node, status: int, log: list[Any]) -> None:
    if status not in (1, 2, 3):
        raise invalid_status_error(status, child)
    if status == RUNNING and child.SYNCHRONOUS:
        child.refuse_running()
    log.append(child.ev[status])
    child._s = status


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


class Fallback(Indexed, composites.Selector):
    """Ticks its children in order; SUCCESS as soon as one succeeds, FAILURE when all failed.

    A running child is resumed at the next tick; children that failed before it are not ticked again.
    """

    CONTINUE_ON, RETURN_ON = FAILURE, SUCCESS
    tick_bare = indexed_tick_bare(FAILURE, SUCCESS)
    tick_traced = indexed_tick_traced(FAILURE, SUCCESS)


class AsyncFallback(Indexed, composites.Selector):
    """A Fallback that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    CONTINUE_ON, RETURN_ON = FAILURE, SUCCESS
    YIELDS = True


class Sequence(Indexed, composites.Sequence):
    """Ticks its children in order; SUCCESS when all succeeded, FAILURE as soon as one fails.

    A running child is resumed at the next tick; the children before it are not ticked again.
    """

    CONTINUE_ON, RETURN_ON = SUCCESS, FAILURE
    tick_bare = indexed_tick_bare(SUCCESS, FAILURE)
    tick_traced = indexed_tick_traced(SUCCESS, FAILURE)


class AsyncSequence(Indexed, composites.Sequence):
    """A Sequence that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    CONTINUE_ON, RETURN_ON = SUCCESS, FAILURE
    YIELDS = True


class SequenceWithMemory(Indexed, composites.Sequence):
    """A Sequence that resumes at the failed child, even after a halt; it yields like AsyncSequence."""

    CONTINUE_ON, RETURN_ON = SUCCESS, FAILURE
    YIELDS = True
    RESETS_ON_HALT = False


class TryCatch(Control, composites.Sequence):
    """Ticks all children but the last as a sequence; when one fails, ticks the last and fails.

    With ``catch_on_halt`` the last child is also ticked, once, when the node is halted.
    """

    MIN_CHILDREN = 2
    catch_on_halt = In(bool, "If true, execute the catch child also when the node is halted", default=False)

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
        if self._s > IDLE and not self.catching and self.catch_on_halt:
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
