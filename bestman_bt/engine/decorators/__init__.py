"""Decorators: nodes with one child."""

from __future__ import annotations

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.decorators.loop import ConsumeQueue, ForEach, LoopBool, LoopDouble, LoopInt, LoopString
from bestman_bt.engine.decorators.precondition import Precondition, SkipUnlessUpdated, WaitValueUpdate
from bestman_bt.engine.decorators.repetition import KeepRunningUntilFailure, Repeat, RetryUntilSuccessful, RunOnce
from bestman_bt.engine.decorators.subtree import ForceFailure, ForceSuccess, Inverter, SubTree
from bestman_bt.engine.decorators.timing import Delay, RateController, Timeout

__all__ = [
    "ConsumeQueue",
    "Decorator",
    "Delay",
    "ForEach",
    "ForceFailure",
    "ForceSuccess",
    "Inverter",
    "KeepRunningUntilFailure",
    "LoopBool",
    "LoopDouble",
    "LoopInt",
    "LoopString",
    "Precondition",
    "RateController",
    "Repeat",
    "RetryUntilSuccessful",
    "RunOnce",
    "SkipUnlessUpdated",
    "SubTree",
    "Timeout",
    "WaitValueUpdate",
]
