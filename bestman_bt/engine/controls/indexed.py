"""Base of Sequence and Fallback: an index that walks over the children and survives RUNNING."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.core.node import Node, odd_status, wrapped
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.status import IDLE, RUNNING, SKIPPED


class Indexed(Control):
    """``GO``: the child status that continues with the next child; ``STOP``: the status that ends the node."""

    GO: ClassVar[int]
    STOP: ClassVar[int]
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
        """Tick the children from the current one on."""
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
            if status == self.STOP:
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
        return SKIPPED if all_skipped else self.GO

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
                    raise odd_status(status, child)
        except NodeError:
            raise
        except Exception as error:
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
                    raise odd_status(status, child)
        except NodeError:
            raise
        except Exception as error:
            raise wrapped(error, child) from error
        all_skipped = self.skipped == count
        self.rest_children()
        self.index = self.skipped = 0
        return SKIPPED if all_skipped else go

    return tick


def _note_change(child: Node, status: int, log: list[Any]) -> None:
    if status not in (1, 2, 3):
        raise odd_status(status, child)
    if status == RUNNING and child.SYNCHRONOUS:
        child.refuse_running()
    log.append(child.ev[status])
    child._s = status
