"""Global planning: costmaps and path planners."""

from bestman_bt.navigation.global_planning.base import GlobalPlanner, PlanningFailure, PlanningFailureReason
from bestman_bt.navigation.global_planning.costmap import Costmap, CostmapParameters
from bestman_bt.navigation.global_planning.footprint import Footprint

__all__ = ["Costmap", "CostmapParameters", "Footprint", "GlobalPlanner", "PlanningFailure", "PlanningFailureReason"]
