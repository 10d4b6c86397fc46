"""Decorators: nodes with one child."""

from __future__ import annotations

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.decorators.mapping import ForceFailure, ForceSuccess, Inverter
from bestman_bt.engine.decorators.repetition import KeepRunningUntilFailure, Repeat, RetryUntilSuccessful
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.decorators.timing import Delay, Timeout

__all__ = [
    "Decorator",
    "Delay",
    "ForceFailure",
    "ForceSuccess",
    "Inverter",
    "KeepRunningUntilFailure",
    "Repeat",
    "RetryUntilSuccessful",
    "SubTree",
    "Timeout",
]
