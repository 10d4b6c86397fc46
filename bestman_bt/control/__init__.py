"""Controllers: they run algorithms on the parts of a robot and hand out handles of what is under way."""

from bestman_bt.control.handle import ControlHandle, ControlStatus
from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.control.pid import PID, PIDParameters

__all__ = [
    "PID",
    "READING_ERRORS",
    "ControlHandle",
    "ControlStatus",
    "PIDParameters",
]
