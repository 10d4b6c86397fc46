"""ReactiveSequence and ReactiveFallback: every child is ticked again at every tick.

Only one child can be RUNNING. It is remembered, so that no tick has to search all children for one to halt; children
that finish become idle immediately.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.core.node import Node, invalid_status_error, wrapped
from bestman_bt.engine.core.tick_hooks import Tick
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


def _reactive_tick_bare(go: int, stop: int) -> Callable[[Any], int]:  # noqa: C901 - it holds a tick, which is one function: each call in it costs
    idle_after_go, idle_after_stop = -go, -stop

    def tick(self: Any) -> int:  # noqa: C901 - a tick is one function: each call in it costs
        self._s = RUNNING
        skipped: list[Node] | None = None
        child = self
        try:
            for run, child in self.pairs:
                status = run()
                if status == go:
                    child._s = idle_after_go
                elif status == RUNNING:
                    if child.SYNCHRONOUS:
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
                    if skipped is None:
                        skipped = []
                    skipped.append(child)
                else:
                    raise invalid_status_error(status, child)
        except NodeError:
            self.keep_results(child, skipped)
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            self.keep_results(child, skipped)
            raise wrapped(error, child) from error
        runner = self.runner
        if runner is not None:
            self.halt_child(runner)
            self.runner = None
        return SKIPPED if skipped is not None and len(skipped) == len(self.pairs) else go

    return tick


def _reactive_tick_traced(go: int, stop: int) -> Callable[[Any], int]:  # noqa: C901 - it holds a tick, which is one function: each call in it costs
    idle_after_go, idle_after_stop = -go, -stop

    def tick(self: Any) -> int:  # noqa: C901 - a tick is one function: each call in it costs
        log = self.log
        append = log.append
        if self._s != RUNNING:
            self._s = RUNNING
            append(self.ev[1])
        skipped: list[int] | None = None
        child = self
        try:
            for run, child, went, index in self.traced_pairs:
                status = run()
                if status == go:
                    if child._s != go:
                        append(went)
                    child._s = idle_after_go
                elif status == RUNNING:
                    if child._s != RUNNING:
                        if child.SYNCHRONOUS:
                            child.refuse_running()
                        append(child.ev[RUNNING])
                        child._s = RUNNING
                    log.extend(self.idles[:index] if skipped is None else self.idle_events(index, skipped))
                    if self.runner is not child:
                        self.replace_runner(child)
                    return RUNNING
                elif status == stop:
                    if child._s != stop:
                        append(child.ev[stop])
                    child._s = idle_after_stop
                    log.extend(self.idles[: index + 1] if skipped is None else self.idle_events(index + 1, skipped))
                    if self.runner is not None:
                        self.replace_runner(None)
                    return stop
                elif status == SKIPPED:
                    if child._s > 0:
                        self.halt_child(child)
                    if skipped is None:
                        skipped = []
                    skipped.append(index)
                else:
                    raise invalid_status_error(status, child)
        except NodeError:
            self.keep_results(child, self.children_at(skipped))
            raise
        except (Exception, SystemExit) as error:  # a user's node may raise anything
            self.keep_results(child, self.children_at(skipped))
            raise wrapped(error, child) from error
        if skipped is None:
            log.extend(self.idles)
        else:
            log.extend(self.idle_events(len(self.idles), skipped))
        if self.runner is not None:
            self.replace_runner(None)
        return SKIPPED if skipped is not None and len(skipped) == len(self.idles) else go

    return tick


class _Reactive(Control):
    runner: Node | None = None
    traced_pairs: list[tuple[Tick, Node, int, int]]
    idles: tuple[int, ...]
    CONTINUE_ON: int

    def bind_children(self, log: list[Any] | None) -> None:
        """Prepare the events of a tick in which no child changes its result, for traced ticks."""
        super().bind_children(log)
        if log is not None:
            pairs = [(run, child, child.ev[self.CONTINUE_ON], index) for index, (run, child) in enumerate(self.pairs)]
            if hasattr(self, "traced_pairs"):
                self.traced_pairs[:] = pairs
            else:
                self.traced_pairs = pairs
            self.idles = tuple(child.ev[0] for _, child in self.pairs)

    def refuse(self, instead: Tick) -> None:
        """Replace the tick of this node and of its children, for traced ticks too."""
        super().refuse(instead)
        if self.log is not None:
            self.traced_pairs[:] = [(instead, child, went, index) for _, child, went, index in self.traced_pairs]

    def idle_events(self, count: int, skipped: list[int]) -> list[int]:
        """Return the events of the first ``count`` children becoming idle, but for those skipped."""
        return [event for i, event in enumerate(self.idles[:count]) if i not in skipped]

    def children_at(self, indices: list[int] | None) -> list[Node]:
        """Return the children with these indices."""
        return [self.pairs[index][1] for index in indices or ()]

    def keep_results(self, failing: Node, skipped: list[Node] | None) -> None:
        """Restore the results of the children before ``failing``, which raised an error: they were not reset."""
        for _, child in self.pairs:
            if child is failing:
                return
            if child._s == -self.CONTINUE_ON and (skipped is None or child not in skipped):
                child._s = self.CONTINUE_ON

    def replace_runner(self, child: Node | None) -> None:
        """Halt the child that ran until now, and remember the one that runs."""
        if self.runner is not None:
            self.halt_child(self.runner)
        self.runner = child

    def halt(self) -> None:
        """Forget the running child and halt it."""
        self.runner = None
        super().halt()


class ReactiveSequence(_Reactive, composites.Sequence):
    """Ticks its children from the first at every tick; a failing condition halts the running child."""

    CONTINUE_ON = SUCCESS
    tick_bare = _reactive_tick_bare(SUCCESS, FAILURE)
    tick_traced = _reactive_tick_traced(SUCCESS, FAILURE)


class ReactiveFallback(_Reactive, composites.Selector):
    """Ticks its children from the first at every tick; a child that succeeds or runs halts the later ones."""

    CONTINUE_ON = FAILURE
    tick_bare = _reactive_tick_bare(FAILURE, SUCCESS)
    tick_traced = _reactive_tick_traced(FAILURE, SUCCESS)
