"""Intel RealSense depth cameras on USB, through pyrealsense2."""

from hal.realsense.connection import RealSenseConnection, RealSenseOptions

__all__ = ["RealSenseConnection", "RealSenseOptions"]
