"""Poses of known objects."""

from bestman_bt.perception.pose_estimation.aruco_pnp import ArucoPnp, ArucoPnpParameters, MarkerPose
from bestman_bt.perception.pose_estimation.base import AMBIGUOUS_YAW, PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart, MultiStartParameters
from bestman_bt.perception.pose_estimation.multi_view import MultiView, MultiViewParameters, Observation

__all__ = [
    "AMBIGUOUS_YAW",
    "ArucoPnp",
    "ArucoPnpParameters",
    "MarkerPose",
    "MultiStart",
    "MultiStartParameters",
    "MultiView",
    "MultiViewParameters",
    "Observation",
    "PoseEstimator",
    "PoseHypothesis",
]
