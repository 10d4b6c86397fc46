"""The composition root: from a configuration to a robot, its beliefs, algorithms and skills, and a running tree.

Names are imported when they are used: who asks for one need not load the algorithms of all.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from bestman_bt.extras import refuse_hidden_packages

if TYPE_CHECKING:
    from bestman_bt.runtime.control_channel import ControlChannel
    from bestman_bt.runtime.executor import Ending, Execution, Executor
    from bestman_bt.runtime.plugins import node_registry
    from bestman_bt.runtime.robot_session import Session, open_session, session
    from bestman_bt.runtime.setup import Setup, load_for, prepare

_HOMES = {
    "ControlChannel": "control_channel",
    "Ending": "executor",
    "Execution": "executor",
    "Executor": "executor",
    "Session": "robot_session",
    "Setup": "setup",
    "load_for": "setup",
    "node_registry": "plugins",
    "open_session": "robot_session",
    "prepare": "setup",
    "session": "robot_session",
}

__all__ = [
    "ControlChannel",
    "Ending",
    "Execution",
    "Executor",
    "Session",
    "Setup",
    "load_for",
    "node_registry",
    "open_session",
    "prepare",
    "session",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    refuse_hidden_packages()
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
