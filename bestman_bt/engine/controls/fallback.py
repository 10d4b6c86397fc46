"""Fallback and AsyncFallback: children in order, until one succeeds."""

from __future__ import annotations

from py_trees import composites

from bestman_bt.engine.controls.indexed import Indexed, indexed_tick_bare, indexed_tick_traced
from bestman_bt.engine.status import FAILURE, SUCCESS


class Fallback(Indexed, composites.Selector):
    """Ticks its children in order; SUCCESS as soon as one succeeds, FAILURE when all failed.

    A child that runs is resumed at the next tick; those that failed before it are not asked again.
    """

    GO, STOP = FAILURE, SUCCESS
    tick_bare = indexed_tick_bare(FAILURE, SUCCESS)
    tick_traced = indexed_tick_traced(FAILURE, SUCCESS)


class AsyncFallback(Indexed, composites.Selector):
    """A Fallback that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    GO, STOP = FAILURE, SUCCESS
    YIELDS = True
