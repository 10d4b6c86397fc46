"""Local planning: path followers."""

from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.braking import GiveWay, braking_time, safe_share
from bestman_bt.navigation.local_planning.dwa import DWA
from bestman_bt.navigation.local_planning.footprint_check import FootprintMotion
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle, MovingObstacles
from bestman_bt.navigation.local_planning.mppi import MPPI
from bestman_bt.navigation.local_planning.obstacle_layer import LocalObstacles, ObstacleLayer
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading
from bestman_bt.navigation.local_planning.swept_path import SweptPath

__all__ = [
    "DWA",
    "MPPI",
    "FollowerCommand",
    "FootprintMotion",
    "GiveWay",
    "LocalObstacles",
    "MovingObstacle",
    "MovingObstacles",
    "ObstacleLayer",
    "PathFollower",
    "PurePursuit",
    "RotateToHeading",
    "SweptPath",
    "braking_time",
    "safe_share",
]
