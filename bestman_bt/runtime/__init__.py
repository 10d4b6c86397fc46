"""The composition root: from a configuration to a robot, its beliefs, algorithms and skills, and a running tree."""

from bestman_bt.runtime.control_channel import ControlChannel
from bestman_bt.runtime.control_client import ControlError, request, running_executors
from bestman_bt.runtime.executor import Ending, Execution, Executor
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.robot_session import Session, open_session, session
from bestman_bt.runtime.setup import Setup, load_for, prepare

__all__ = [
    "ControlChannel",
    "ControlError",
    "Ending",
    "Execution",
    "Executor",
    "Session",
    "Setup",
    "load_for",
    "node_registry",
    "open_session",
    "prepare",
    "request",
    "running_executors",
    "session",
]
