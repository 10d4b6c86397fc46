"""Control nodes: those with several children."""

from __future__ import annotations

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.controls.branching import IfThenElse, WhileDoElse
from bestman_bt.engine.controls.fallback import AsyncFallback, Fallback
from bestman_bt.engine.controls.parallel import Parallel, ParallelAll
from bestman_bt.engine.controls.reactive import ReactiveFallback, ReactiveSequence
from bestman_bt.engine.controls.sequence import AsyncSequence, Sequence, SequenceWithMemory

__all__ = [
    "AsyncFallback",
    "AsyncSequence",
    "Control",
    "Fallback",
    "IfThenElse",
    "Parallel",
    "ParallelAll",
    "ReactiveFallback",
    "ReactiveSequence",
    "Sequence",
    "SequenceWithMemory",
    "WhileDoElse",
]
