"""Global planning: costmaps and path planners."""

from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap, CostmapParameters
from bestman_bt.navigation.global_planning.footprint import Footprint, Overhang
from bestman_bt.navigation.global_planning.grid_astar import GridAStar, GridAStarParameters
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, shortest_length
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar, HybridAStarParameters
from bestman_bt.navigation.global_planning.layered_costmap import LayeredCostmap, LayeredCostmapParameters
from bestman_bt.navigation.global_planning.prm import PRM, PRMParameters
from bestman_bt.navigation.global_planning.rrt_star import RRTStar, RRTStarParameters
from bestman_bt.navigation.global_planning.theta_star import ThetaStar, ThetaStarParameters

__all__ = [
    "PRM",
    "Costmap",
    "CostmapParameters",
    "Footprint",
    "GlobalPlanner",
    "GridAStar",
    "GridAStarParameters",
    "HybridAStar",
    "HybridAStarParameters",
    "LayeredCostmap",
    "LayeredCostmapParameters",
    "Overhang",
    "PRMParameters",
    "PlanningFailure",
    "PlanningFailureReason",
    "RRTStar",
    "RRTStarParameters",
    "ThetaStar",
    "ThetaStarParameters",
    "areas_of_disc",
    "shortest_length",
]
