"""Mobile bases, heads, cameras and other sensors behind a ROS robot, over rosbridge."""

from hal.rosbridge.connection import RosbridgeConnection
from hal.rosbridge.options import RosbridgeOptions

__all__ = ["RosbridgeConnection", "RosbridgeOptions"]
