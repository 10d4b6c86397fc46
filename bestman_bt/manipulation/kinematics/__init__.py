"""Kinematics: frames of the whole robot, inverse kinematics, paths of the tool, reachability, where to stand."""

from bestman_bt.manipulation.kinematics.arc_path import (
    ArcPath,
    ArcPathParameters,
    IsFreeAt,
    Stations,
    arc_path,
    arc_path_through,
)
from bestman_bt.manipulation.kinematics.arm_bodies import ArmBodies
from bestman_bt.manipulation.kinematics.arm_dynamics import ArmDynamics
from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.manipulation.kinematics.cartesian_path import CartesianPath, cartesian_path
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares, DampedLeastSquaresParameters
from bestman_bt.manipulation.kinematics.forward import ForwardKinematics
from bestman_bt.manipulation.kinematics.link_hulls import body_between, link_hulls
from bestman_bt.manipulation.kinematics.reachability_cache import reachability_map
from bestman_bt.manipulation.kinematics.reachability_map import (
    ReachabilityMap,
    ReachabilityMapParameters,
    build_reachability_map,
)
from bestman_bt.manipulation.kinematics.stand_along import (
    StandAlong,
    StandAlongParameters,
    promising_stands,
    rank_stand_poses_along,
    stands_around,
)
from bestman_bt.manipulation.kinematics.stand_pose import (
    StandPose,
    StandPoseParameters,
    rank_stand_poses,
    stands_along,
)

__all__ = [
    "ArcPath",
    "ArcPathParameters",
    "ArmBodies",
    "ArmDynamics",
    "CartesianPath",
    "DampedLeastSquares",
    "DampedLeastSquaresParameters",
    "ForwardKinematics",
    "IKResult",
    "InverseKinematics",
    "IsFreeAt",
    "ReachabilityMap",
    "ReachabilityMapParameters",
    "StandAlong",
    "StandAlongParameters",
    "StandPose",
    "StandPoseParameters",
    "Stations",
    "arc_path",
    "arc_path_through",
    "body_between",
    "build_reachability_map",
    "cartesian_path",
    "link_hulls",
    "promising_stands",
    "rank_stand_poses",
    "rank_stand_poses_along",
    "reachability_map",
    "stands_along",
    "stands_around",
]
