"""Controllers: they run algorithms on the parts of a robot and hand out handles of what is under way."""

from bestman_bt.control.handle import ControlHandle, ControlStatus
from bestman_bt.control.pid import PID, PIDParameters
from bestman_bt.control.reading import READING_ERRORS

__all__ = [
    "PID",
    "READING_ERRORS",
    "ControlHandle",
    "ControlStatus",
    "PIDParameters",
]
