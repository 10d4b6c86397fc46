"""File logs and statistics of a tree's state changes. Each attaches itself to a tree and costs nothing once closed."""

from __future__ import annotations

from bestman_bt.engine.logs.btlog import BtLog, BtLogWriter, LogError, Transition, Transitions, read_btlog
from bestman_bt.engine.logs.observer import NodeStatistics, TreeObserver

__all__ = [
    "BtLog",
    "BtLogWriter",
    "LogError",
    "NodeStatistics",
    "Transition",
    "Transitions",
    "TreeObserver",
    "read_btlog",
]
