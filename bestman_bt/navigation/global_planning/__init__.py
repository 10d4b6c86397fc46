"""Global planning: costmaps and path planners."""

from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap, CostmapParameters
from bestman_bt.navigation.global_planning.footprint import Footprint
from bestman_bt.navigation.global_planning.grid_astar import GridAStar, GridAStarParameters
from bestman_bt.navigation.global_planning.grid_search import areas_of_disc, shortest_length

__all__ = [
    "Costmap",
    "CostmapParameters",
    "Footprint",
    "GlobalPlanner",
    "GridAStar",
    "GridAStarParameters",
    "PlanningFailure",
    "PlanningFailureReason",
    "areas_of_disc",
    "shortest_length",
]
