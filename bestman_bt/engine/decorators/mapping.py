"""Inverter, ForceSuccess and ForceFailure: the child's result, changed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.errors import NodeError
from bestman_bt.engine.node_errors import odd_status, wrapped
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


def mapping_tick_bare(on_success: int, on_failure: int, *, keeps: bool = False) -> Callable[[Any], int]:
    """Return the tick of a decorator that maps its child's result, while nobody listens.

    With ``keeps`` the node's own result of before, which nobody reset, outlives a child that is skipped.
    """

    def tick(self: Any) -> int:
        code = self._s
        self._s = RUNNING
        run, child = self.only
        try:
            status = run()
        except NodeError:
            if keeps and code > RUNNING:
                self._s = code
            raise
        except Exception as error:
            raise wrapped(error, child) from error
        if status == RUNNING:
            if child._s != RUNNING:
                if child.SYNCHRONOUS:
                    child.refuse_running()
                child._s = RUNNING
            return RUNNING
        if status == SUCCESS:
            child._s = -SUCCESS
            return on_success
        if status == FAILURE:
            child._s = -FAILURE
            return on_failure
        if status == SKIPPED:
            if keeps and code > RUNNING:
                self._s = code
            return SKIPPED
        raise odd_status(status, child)

    return tick


def mapping_tick_traced(on_success: int, on_failure: int) -> Callable[[Any], int]:
    """Return the same tick, logging every state change."""

    def tick(self: Any) -> int:
        log = self.log
        if self._s != RUNNING:
            self._s = RUNNING
            log.append(self.ev[1])
        run, child = self.only
        try:
            status = run()
        except NodeError:
            raise
        except Exception as error:
            raise wrapped(error, child) from error
        if status == RUNNING:
            if child._s != RUNNING:
                if child.SYNCHRONOUS:
                    child.refuse_running()
                child._s = RUNNING
                log.append(child.ev[1])
            return RUNNING
        if status == SUCCESS or status == FAILURE:
            events = child.ev
            if child._s != status:
                log.append(events[status])
            log.append(events[0])
            child._s = -status
            return on_success if status == SUCCESS else on_failure
        if status == SKIPPED:
            return SKIPPED
        raise odd_status(status, child)

    return tick


class Inverter(Decorator):
    """SUCCESS becomes FAILURE and FAILURE becomes SUCCESS."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(FAILURE, SUCCESS)
    tick_traced = mapping_tick_traced(FAILURE, SUCCESS)


class ForceSuccess(Decorator):
    """SUCCESS, whatever the child's result is."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(SUCCESS, SUCCESS)
    tick_traced = mapping_tick_traced(SUCCESS, SUCCESS)


class ForceFailure(Decorator):
    """FAILURE, whatever the child's result is."""

    RESETS_CHILD = True
    tick_bare = mapping_tick_bare(FAILURE, FAILURE)
    tick_traced = mapping_tick_traced(FAILURE, FAILURE)
