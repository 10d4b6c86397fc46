"""Motion planning for arms."""

from bestman_bt.manipulation.motion_planning.approach import Approach, ApproachPoses, approaches
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.ompl_planners import AORRTC, KPIECE, BITStar, RRTStar
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect
from bestman_bt.manipulation.motion_planning.timed_planner import Escape, TimedMotionPlanner, TimedPlan
from bestman_bt.manipulation.motion_planning.upright import Upright

__all__ = [
    "AORRTC",
    "KPIECE",
    "Approach",
    "ApproachPoses",
    "BITStar",
    "Escape",
    "MotionPlan",
    "MotionPlanner",
    "PathConstraint",
    "PlanningError",
    "PlanningErrorCode",
    "Portfolio",
    "RRTConnect",
    "RRTStar",
    "TimedMotionPlanner",
    "TimedPlan",
    "Upright",
    "approaches",
]
