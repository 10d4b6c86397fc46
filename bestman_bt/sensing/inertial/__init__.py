"""Inertial sensing."""

from bestman_bt.sensing.inertial.gyro_heading import GyroHeading

__all__ = ["GyroHeading"]
