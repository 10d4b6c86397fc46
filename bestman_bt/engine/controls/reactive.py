"""ReactiveSequence and ReactiveFallback: every child is asked anew at every tick.

Only one child can be RUNNING. It is remembered, so that no tick has to look through all children to halt others;
children that finish become idle at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.node import Node, Tick, odd_status, wrapped
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


def _reactive_tick_bare(go: int, stop: int) -> Callable[[Any], int]:
    idle_after_go, idle_after_stop = -go, -stop

    def tick(self: Any) -> int:
        self._s = RUNNING
        all_skipped = True
        child = self
        try:
            for run, child in self.pairs:
                status = run()
                if status == go:
                    child._s = idle_after_go
                    all_skipped = False
                elif status == RUNNING:
                    if child.NEVER_RUNS:
                        child.refuse_running()
                    child._s = RUNNING
                    runner = self.runner
                    if runner is not child:
                        if runner is not None:
                            self.halt_child(runner)
                        self.runner = child
                    return RUNNING
                elif status == stop:
                    child._s = idle_after_stop
                    runner = self.runner
                    if runner is not None:
                        self.halt_child(runner)
                        self.runner = None
                    return stop
                elif status == SKIPPED:
                    if child._s > 0:
                        self.halt_child(child)
                else:
                    raise odd_status(status, child)
        except NodeError:
            raise
        except Exception as error:
            raise wrapped(error, child) from error
        runner = self.runner
        if runner is not None:
            self.halt_child(runner)
            self.runner = None
        return SKIPPED if all_skipped else go

    return tick


def _reactive_tick_traced(go: int, stop: int) -> Callable[[Any], int]:
    def tick(self: Any) -> int:
        log = self.log
        if self._s != RUNNING:
            self._s = RUNNING
            log.append(self.ev[1])
        index = 0
        skipped: list[int] = []
        child = self
        try:
            for run, child, went in self.traced_pairs:
                status = run()
                if status == go:
                    if child._s != go:
                        log.append(went)
                    child._s = -go
                    index += 1
                elif status == RUNNING or status == stop:
                    if status == RUNNING and child.NEVER_RUNS:
                        child.refuse_running()
                    if child._s != status:
                        log.append(child.ev[status])
                    self.settle(status, child, index, skipped)
                    return RUNNING if status == RUNNING else stop
                elif status == SKIPPED:
                    if child._s > 0:
                        self.halt_child(child)
                    skipped.append(index)
                    index += 1
                else:
                    raise odd_status(status, child)
        except NodeError:
            raise
        except Exception as error:
            raise wrapped(error, child) from error
        log.extend(self.idle_events(index, skipped) if skipped else self.idles)
        runner = self.runner
        if runner is not None:
            self.halt_child(runner)
            self.runner = None
        return SKIPPED if len(skipped) == index else go

    return tick


class _Reactive(Control):
    runner: Node | None = None
    traced_pairs: list[tuple[Tick, Node, int]]
    idles: tuple[int, ...]
    GO: int

    def bind_children(self, log: list[Any] | None) -> None:
        """Prepare the events of a tick in which everything goes on, while somebody listens."""
        super().bind_children(log)
        if log is not None:
            self.traced_pairs = [(run, child, child.ev[self.GO]) for run, child in self.pairs]
            self.idles = tuple(child.ev[0] for _, child in self.pairs)

    def idle_events(self, count: int, skipped: list[int]) -> list[int]:
        """Return the events of the first ``count`` children becoming idle, but for those skipped."""
        return [event for i, event in enumerate(self.idles[:count]) if i not in skipped]

    def settle(self, status: int, child: Node, index: int, skipped: list[int]) -> None:
        """End a traced tick at a child that runs or stops the node."""
        log = self.log
        assert log is not None
        if status == RUNNING:
            child._s = RUNNING
            running: Node | None = child
            log.extend(self.idle_events(index, skipped))
        else:
            child._s = -status
            running = None
            log.extend(self.idle_events(index + 1, skipped))
        runner = self.runner
        if runner is not running:
            if runner is not None:
                self.halt_child(runner)
            self.runner = running

    def halt(self) -> None:
        """Forget the running child and halt it."""
        self.runner = None
        super().halt()


class ReactiveSequence(_Reactive, composites.Sequence):
    """Asks its children from the first on at every tick; a guard that fails halts the child that runs."""

    GO = SUCCESS
    tick_bare = _reactive_tick_bare(SUCCESS, FAILURE)
    tick_traced = _reactive_tick_traced(SUCCESS, FAILURE)


class ReactiveFallback(_Reactive, composites.Selector):
    """Asks its children from the first on at every tick; one that succeeds or runs halts those after it."""

    GO = FAILURE
    tick_bare = _reactive_tick_bare(FAILURE, SUCCESS)
    tick_traced = _reactive_tick_traced(FAILURE, SUCCESS)
