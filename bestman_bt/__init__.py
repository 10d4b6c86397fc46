"""Behavior-tree task execution for mobile manipulators.

``with bestman_bt.session(robot="diff_panda", scene="kitchen", seed=1) as s: s.run("fetch_cup")``
"""

from __future__ import annotations

from typing import Any

__all__ = ["session"]


def __getattr__(name: str) -> Any:
    """Import ``session`` when it is used: the engine alone should not load the simulator."""
    if name == "session":
        from bestman_bt.runtime import session

        return session
    raise AttributeError(f"module 'bestman_bt' has no attribute {name!r}")
