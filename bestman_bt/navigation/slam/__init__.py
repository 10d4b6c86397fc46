"""SLAM: maps made on the way."""

from bestman_bt.navigation.slam.base import Slam, SlamEstimate, SlamTrajectory
from bestman_bt.navigation.slam.correlative import (
    CorrelativeMatch,
    CorrelativeMatcher,
    LikelihoodPyramid,
    SearchWindow,
)
from bestman_bt.navigation.slam.frontiers import (
    Frontier,
    FrontierExplorer,
    FrontierView,
    find_frontiers,
)
from bestman_bt.navigation.slam.loop_closure import LoopCloser
from bestman_bt.navigation.slam.oriented_points import OrientedPoints, oriented_points
from bestman_bt.navigation.slam.overhangs import Overhangs
from bestman_bt.navigation.slam.point_to_line import LineReference, PointToLine, ScanAlignment
from bestman_bt.navigation.slam.pose_graph import Constraint, PoseGraph
from bestman_bt.navigation.slam.pose_graph_slam import LogOddsGrid, PoseGraphSlam, SlamLocalizer

__all__ = [
    "Constraint",
    "CorrelativeMatch",
    "CorrelativeMatcher",
    "Frontier",
    "FrontierExplorer",
    "FrontierView",
    "LikelihoodPyramid",
    "LineReference",
    "LogOddsGrid",
    "LoopCloser",
    "OrientedPoints",
    "Overhangs",
    "PointToLine",
    "PoseGraph",
    "PoseGraphSlam",
    "ScanAlignment",
    "SearchWindow",
    "Slam",
    "SlamEstimate",
    "SlamLocalizer",
    "SlamTrajectory",
    "find_frontiers",
    "oriented_points",
]
