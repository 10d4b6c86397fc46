"""Control nodes: those with several children."""

from __future__ import annotations

from bestman_bt.engine.controls.base import Control
from bestman_bt.engine.controls.nav2 import PipelineSequence, RecoveryNode, RoundRobin
from bestman_bt.engine.controls.parallel import Parallel, ParallelAll
from bestman_bt.engine.controls.reactive import ReactiveFallback, ReactiveSequence
from bestman_bt.engine.controls.sequence import (
    AsyncFallback,
    AsyncSequence,
    Fallback,
    IfThenElse,
    Sequence,
    SequenceWithMemory,
    TryCatch,
    WhileDoElse,
)
from bestman_bt.engine.controls.switch import ManualSelector, Switch2, Switch3, Switch4, Switch5, Switch6

__all__ = [
    "AsyncFallback",
    "AsyncSequence",
    "Control",
    "Fallback",
    "IfThenElse",
    "ManualSelector",
    "Parallel",
    "ParallelAll",
    "PipelineSequence",
    "ReactiveFallback",
    "ReactiveSequence",
    "RecoveryNode",
    "RoundRobin",
    "Sequence",
    "SequenceWithMemory",
    "Switch2",
    "Switch3",
    "Switch4",
    "Switch5",
    "Switch6",
    "TryCatch",
    "WhileDoElse",
]
