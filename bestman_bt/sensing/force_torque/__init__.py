"""Force-torque sensing."""

from bestman_bt.sensing.force_torque.wrist_wrench import WristWrench, WristWrenchParameters

__all__ = ["WristWrench", "WristWrenchParameters"]
