"""File logs and statistics of a tree's state changes. Each attaches itself to a tree and costs nothing once closed."""

from __future__ import annotations

from bestman_bt.engine.logs.btlog import BtLog, BtLogWriter, LogError, read_btlog
from bestman_bt.engine.logs.chrome_trace import ChromeTraceWriter
from bestman_bt.engine.logs.json_lines import JsonLinesWriter, read_json_lines
from bestman_bt.engine.logs.observer import NodeStatistics, TreeObserver
from bestman_bt.engine.logs.sqlite import SqliteWriter
from bestman_bt.engine.logs.stamped import TransitionLog
from bestman_bt.engine.logs.transitions import Transition, Transitions

__all__ = [
    "BtLog",
    "BtLogWriter",
    "ChromeTraceWriter",
    "JsonLinesWriter",
    "LogError",
    "NodeStatistics",
    "SqliteWriter",
    "Transition",
    "TransitionLog",
    "Transitions",
    "TreeObserver",
    "read_btlog",
    "read_json_lines",
]
