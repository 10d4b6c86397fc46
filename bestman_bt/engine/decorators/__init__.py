"""Decorators: nodes with one child."""

from __future__ import annotations

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.decorators.consume_queue import ConsumeQueue
from bestman_bt.engine.decorators.for_each import ForEach
from bestman_bt.engine.decorators.loop import LoopBool, LoopDouble, LoopInt, LoopString
from bestman_bt.engine.decorators.mapping import ForceFailure, ForceSuccess, Inverter
from bestman_bt.engine.decorators.precondition import Precondition
from bestman_bt.engine.decorators.rate_controller import RateController
from bestman_bt.engine.decorators.repetition import KeepRunningUntilFailure, Repeat, RetryUntilSuccessful
from bestman_bt.engine.decorators.run_once import RunOnce
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.decorators.timing import Delay, Timeout
from bestman_bt.engine.decorators.updated import SkipUnlessUpdated, WaitValueUpdate

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
