"""Kinematics: frames of the whole robot, inverse kinematics, straight tool motion, where to stand."""

from bestman_bt.manipulation.kinematics.base import IKResult, InverseKinematics

__all__ = ["IKResult", "InverseKinematics"]
