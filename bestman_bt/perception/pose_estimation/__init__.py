"""Poses of known objects."""

from bestman_bt.perception.pose_estimation.base import PoseEstimator, PoseHypothesis

__all__ = ["PoseEstimator", "PoseHypothesis"]
