"""Poses of known objects."""

from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis
from bestman_bt.perception.pose_estimation.multi_start import MultiStart, MultiStartParameters

__all__ = ["MultiStart", "MultiStartParameters", "PoseEstimator", "PoseHypothesis"]
