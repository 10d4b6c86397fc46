"""SLAM: maps made on the way."""

from bestman_bt.navigation.slam.base import Slam, SlamEstimate, SlamTrajectory
from bestman_bt.navigation.slam.correlative import (
    CorrelativeMatch,
    CorrelativeMatcher,
    CorrelativeParameters,
    SearchWindow,
)
from bestman_bt.navigation.slam.frontiers import (
    Frontier,
    FrontierExplorer,
    FrontierExplorerParameters,
    FrontierView,
    find_frontiers,
)
from bestman_bt.navigation.slam.log_odds_grid import LogOddsGrid, LogOddsGridParameters
from bestman_bt.navigation.slam.loop_closure import LoopCloser, LoopClosureParameters
from bestman_bt.navigation.slam.oriented_points import OrientedPoints, oriented_points
from bestman_bt.navigation.slam.overhangs import Overhangs, OverhangsParameters
from bestman_bt.navigation.slam.point_to_line import LineReference, PointToLineParameters, ScanAlignment
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph, PoseGraphParameters
from bestman_bt.navigation.slam.pose_graph_slam import PoseGraphSlam, PoseGraphSlamParameters
from bestman_bt.navigation.slam.slam_localizer import SlamLocalizer

__all__ = [
    "Constraint",
    "CorrelativeMatch",
    "CorrelativeMatcher",
    "CorrelativeParameters",
    "Frontier",
    "FrontierExplorer",
    "FrontierExplorerParameters",
    "FrontierView",
    "LineReference",
    "LogOddsGrid",
    "LogOddsGridParameters",
    "LoopCloser",
    "LoopClosureParameters",
    "OrientedPoints",
    "Overhangs",
    "OverhangsParameters",
    "PointToLineParameters",
    "PoseGraph",
    "PoseGraphParameters",
    "PoseGraphSlam",
    "PoseGraphSlamParameters",
    "ScanAlignment",
    "SearchWindow",
    "Slam",
    "SlamEstimate",
    "SlamLocalizer",
    "SlamTrajectory",
    "find_frontiers",
    "oriented_points",
]
