"""Sequence, AsyncSequence and SequenceWithMemory: children in order, until one fails."""

from __future__ import annotations

from py_trees import composites

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.controls.indexed import Indexed, indexed_tick_bare, indexed_tick_traced
from bestman_bt.engine.status import FAILURE, SUCCESS


class Sequence(Indexed, composites.Sequence):
    """Ticks its children in order; SUCCESS when all succeeded, FAILURE as soon as one fails.

    A child that runs is resumed at the next tick; its predecessors are not asked again.
    """

    GO, STOP = SUCCESS, FAILURE
    tick_bare = indexed_tick_bare(SUCCESS, FAILURE)
    tick_traced = indexed_tick_traced(SUCCESS, FAILURE)


class AsyncSequence(Indexed, composites.Sequence):
    """A Sequence that returns RUNNING, and wakes the loop, between children that finish within one tick."""

    GO, STOP = SUCCESS, FAILURE
    YIELDS = True


class SequenceWithMemory(Indexed, composites.Sequence):
    """A Sequence that resumes at the child that failed, also after a halt; it yields like AsyncSequence."""

    GO, STOP = SUCCESS, FAILURE
    YIELDS = True
    RESETS_ON_HALT = False


__all__ = ["AsyncSequence", "Control", "Sequence", "SequenceWithMemory"]
