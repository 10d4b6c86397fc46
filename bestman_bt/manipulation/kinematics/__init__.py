"""Kinematics: frames of the whole robot, inverse kinematics, paths of the tool, reachability, where to stand."""

from bestman_bt.manipulation.kinematics.arc_path import (
    ArcPath,
    ArcSearch,
    IsFreeAt,
    Stations,
)
from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.manipulation.kinematics.cartesian_path import CartesianPath, cartesian_path
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares
from bestman_bt.manipulation.kinematics.link_hulls import ArmBodies, ForwardKinematics, body_between, link_hulls
from bestman_bt.manipulation.kinematics.reachability_map import (
    ReachabilityMap,
    ReachabilitySampling,
    reachability_map,
)
from bestman_bt.manipulation.kinematics.stand_along import (
    ArcStands,
    StandAlong,
    stands_around,
)
from bestman_bt.manipulation.kinematics.stand_pose import (
    ReachingArm,
    StandPose,
    StandSearch,
)

__all__ = [
    "ArcPath",
    "ArcSearch",
    "ArcStands",
    "ArmBodies",
    "CartesianPath",
    "DampedLeastSquares",
    "ForwardKinematics",
    "IKResult",
    "InverseKinematics",
    "IsFreeAt",
    "ReachabilityMap",
    "ReachabilitySampling",
    "ReachingArm",
    "StandAlong",
    "StandPose",
    "StandSearch",
    "Stations",
    "body_between",
    "cartesian_path",
    "link_hulls",
    "reachability_map",
    "stands_around",
]
