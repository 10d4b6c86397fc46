"""Intel RealSense depth cameras on USB, through pyrealsense2."""
