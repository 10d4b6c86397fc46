"""Local planning: path followers."""

from bestman_bt.navigation.local_planning.base import FollowerCommand, PathFollower
from bestman_bt.navigation.local_planning.braking import braking_time, safe_share
from bestman_bt.navigation.local_planning.dwa import DWA, DWAParameters
from bestman_bt.navigation.local_planning.footprint_motion import FootprintMotion
from bestman_bt.navigation.local_planning.give_way import GiveWay, GiveWayParameters
from bestman_bt.navigation.local_planning.local_obstacles import LocalObstacles, LocalObstaclesParameters
from bestman_bt.navigation.local_planning.moving_obstacles import MovingObstacle, MovingObstacles
from bestman_bt.navigation.local_planning.mppi import MPPI, MPPIParameters
from bestman_bt.navigation.local_planning.obstacle_layer import ObstacleLayer, ObstacleLayerParameters
from bestman_bt.navigation.local_planning.pure_pursuit import PurePursuit, PurePursuitParameters
from bestman_bt.navigation.local_planning.rotate_to_heading import RotateToHeading, RotateToHeadingParameters
from bestman_bt.navigation.local_planning.swept_path import SweptPath

__all__ = [
    "DWA",
    "MPPI",
    "DWAParameters",
    "FollowerCommand",
    "FootprintMotion",
    "GiveWay",
    "GiveWayParameters",
    "LocalObstacles",
    "LocalObstaclesParameters",
    "MPPIParameters",
    "MovingObstacle",
    "MovingObstacles",
    "ObstacleLayer",
    "ObstacleLayerParameters",
    "PathFollower",
    "PurePursuit",
    "PurePursuitParameters",
    "RotateToHeading",
    "RotateToHeadingParameters",
    "SweptPath",
    "braking_time",
    "safe_share",
]
