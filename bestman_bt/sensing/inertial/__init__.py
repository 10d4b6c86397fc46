"""Inertial sensing."""

from bestman_bt.sensing.inertial.fused_odometry import FusedOdometry
from bestman_bt.sensing.inertial.gyro_heading import GyroHeading

__all__ = ["FusedOdometry", "GyroHeading"]
