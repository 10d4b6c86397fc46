"""Controllers: run algorithms on the parts of a robot and return motions."""

from hal.api import Motion, MotionStatus

__all__ = ["Motion", "MotionStatus"]
