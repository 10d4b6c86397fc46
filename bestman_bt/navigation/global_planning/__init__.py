"""Global planning: costmaps and path planners."""

from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap, Rasterization
from bestman_bt.navigation.global_planning.footprint import Footprint, Overhang
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, shortest_length
from bestman_bt.navigation.global_planning.hybrid_astar import HybridAStar
from bestman_bt.navigation.global_planning.layered_costmap import LayeredCostmap
from bestman_bt.navigation.global_planning.polyline_planner import GridAStar
from bestman_bt.navigation.global_planning.theta_star import ThetaStar

__all__ = [
    "Costmap",
    "Footprint",
    "GlobalPlanner",
    "GridAStar",
    "HybridAStar",
    "LayeredCostmap",
    "Overhang",
    "PlanningFailure",
    "PlanningFailureReason",
    "Rasterization",
    "ThetaStar",
    "areas_of_disc",
    "shortest_length",
]
