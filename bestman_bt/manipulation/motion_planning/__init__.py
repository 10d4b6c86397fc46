"""Motion planning for arms."""

from bestman_bt.manipulation.motion_planning.approach import Approach, approaches
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect, RRTConnectParameters
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner, TimedPlan
from bestman_bt.manipulation.motion_planning.upright import Upright

__all__ = [
    "Approach",
    "MotionPlan",
    "MotionPlanner",
    "PathConstraint",
    "PlanningError",
    "PlanningErrorCode",
    "RRTConnect",
    "RRTConnectParameters",
    "TimedMotionPlanner",
    "TimedPlan",
    "Upright",
    "approaches",
]
