"""Behavior-tree task execution for mobile manipulators.

``with bestman_bt.session(robot="diff_panda", scene="kitchen", seed=1) as s: s.run("fetch_cup")``
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["session"]


def __getattr__(name: str) -> Any:
    """Import ``session`` when it is used: the engine alone should not load the simulator."""
    if name == "session":
        return import_module("bestman_bt.runtime").session
    raise AttributeError(f"module 'bestman_bt' has no attribute {name!r}")
