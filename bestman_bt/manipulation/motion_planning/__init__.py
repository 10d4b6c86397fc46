"""Motion planning for arms."""

from bestman_bt.manipulation.motion_planning.aorrtc import AORRTC, AORRTCParameters
from bestman_bt.manipulation.motion_planning.approach import Approach, approaches
from bestman_bt.manipulation.motion_planning.base import (
    MotionPlan,
    MotionPlanner,
    PathConstraint,
    PlanningError,
    PlanningErrorCode,
)
from bestman_bt.manipulation.motion_planning.bit_star import BITStar, BITStarParameters
from bestman_bt.manipulation.motion_planning.escape import EscapeParameters, escape_path
from bestman_bt.manipulation.motion_planning.kpiece import KPIECE, KPIECEParameters
from bestman_bt.manipulation.motion_planning.path_cache import PathCache, PathCacheParameters
from bestman_bt.manipulation.motion_planning.portfolio import Portfolio, PortfolioParameters
from bestman_bt.manipulation.motion_planning.prm import PRM, PRMParameters
from bestman_bt.manipulation.motion_planning.rrt_connect import RRTConnect, RRTConnectParameters
from bestman_bt.manipulation.motion_planning.rrt_star import RRTStar, RRTStarParameters
from bestman_bt.manipulation.motion_planning.timed_planner import TimedMotionPlanner, TimedPlan
from bestman_bt.manipulation.motion_planning.upright import Upright

__all__ = [
    "AORRTC",
    "KPIECE",
    "PRM",
    "AORRTCParameters",
    "Approach",
    "BITStar",
    "BITStarParameters",
    "EscapeParameters",
    "KPIECEParameters",
    "MotionPlan",
    "MotionPlanner",
    "PRMParameters",
    "PathCache",
    "PathCacheParameters",
    "PathConstraint",
    "PlanningError",
    "PlanningErrorCode",
    "Portfolio",
    "PortfolioParameters",
    "RRTConnect",
    "RRTConnectParameters",
    "RRTStar",
    "RRTStarParameters",
    "TimedMotionPlanner",
    "TimedPlan",
    "Upright",
    "approaches",
    "escape_path",
]
