"""Controllers: they run algorithms on the parts of a robot and hand out motions that are under way."""

from bestman_bt.control.joint_state import READING_ERRORS
from bestman_bt.control.pid import PID, PIDParameters
from hal.api import Motion, MotionStatus

__all__ = [
    "PID",
    "READING_ERRORS",
    "Motion",
    "MotionStatus",
    "PIDParameters",
]
