"""File logs of a tree's state changes. Each attaches itself to a tree and costs nothing once it is closed."""

from __future__ import annotations

from bestman_bt.engine.logs.btlog import BtLog, BtLogWriter, read_btlog

__all__ = ["BtLog", "BtLogWriter", "read_btlog"]
