"""Motion planning for arms."""

from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)

__all__ = ["MotionPlan", "MotionPlanner", "PathConstraint", "PlanningError", "PlanningErrorCode"]
