"""Kinematics: frames of the whole robot, inverse kinematics, straight tool motion, where to stand."""

from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics
from bestman_bt.manipulation.kinematics.cartesian_path import CartesianPath, cartesian_path
from bestman_bt.manipulation.kinematics.damped_least_squares import DampedLeastSquares, DampedLeastSquaresParameters
from bestman_bt.manipulation.kinematics.forward import ForwardKinematics
from bestman_bt.manipulation.kinematics.link_hulls import link_hulls
from bestman_bt.manipulation.kinematics.stand_pose import (
    StandPose,
    StandPoseParameters,
    rank_stand_poses,
    stands_along,
)

__all__ = [
    "CartesianPath",
    "DampedLeastSquares",
    "DampedLeastSquaresParameters",
    "ForwardKinematics",
    "IKResult",
    "InverseKinematics",
    "StandPose",
    "StandPoseParameters",
    "cartesian_path",
    "link_hulls",
    "rank_stand_poses",
    "stands_along",
]
