"""Poses of known objects."""

from bestman_bt.perception.pose_estimation.base import AMBIGUOUS_YAW, PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart
from bestman_bt.perception.pose_estimation.multi_view import MultiView, ViewObservation

__all__ = [
    "AMBIGUOUS_YAW",
    "MultiStart",
    "MultiView",
    "PoseEstimator",
    "PoseHypothesis",
    "ViewObservation",
]
