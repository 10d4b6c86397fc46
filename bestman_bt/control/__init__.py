"""Controllers: they run algorithms on the parts of a robot and hand out motions that are under way."""

from bestman_bt.control.joint_state import READING_ERRORS
from hal.api import Motion, MotionStatus

__all__ = [
    "READING_ERRORS",
    "Motion",
    "MotionStatus",
]
