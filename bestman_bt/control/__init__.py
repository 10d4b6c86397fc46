"""Controllers: they run algorithms on the parts of a robot and hand out handles of what is under way."""

from bestman_bt.control.handle import ControlError, ControlErrorCode, ControlHandle, ControlStatus
from bestman_bt.control.pid import PID, PIDParameters

__all__ = ["PID", "ControlError", "ControlErrorCode", "ControlHandle", "ControlStatus", "PIDParameters"]
