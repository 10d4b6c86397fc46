"""Lidar sensing."""

from bestman_bt.sensing.lidar.lidar_sensor import LidarSensor

__all__ = ["LidarSensor"]
