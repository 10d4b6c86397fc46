"""Behavior-tree task execution for mobile manipulators.

``with bestman_bt.session(robot="diff_panda", scene="kitchen", seed=1) as s: s.run("fetch_cup")``
``bestman_bt.plan("on(cup, counter)", scene="kitchen_furnished").run()``
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__all__ = ["plan", "session"]


def __getattr__(name: str) -> Any:
    """Import what is used when it is used: the engine alone should not load the simulator."""
    if name == "plan":
        return import_module("bestman_bt.runtime.planning").plan
    if name == "session":
        return import_module("bestman_bt.runtime").session
    raise AttributeError(f"module 'bestman_bt' has no attribute {name!r}")
