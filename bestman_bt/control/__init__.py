"""Controllers: they run algorithms on the parts of a robot and hand out motions that are under way."""

from hal.api import Motion, MotionStatus

__all__ = ["Motion", "MotionStatus"]
