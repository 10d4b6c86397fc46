"""UFACTORY xArm through the vendor's SDK (extra ``xarm``), which is imported when a controller is connected."""

from hal.xarm.connection import XArmConnection
from hal.xarm.options import XArmOptions

__all__ = ["XArmConnection", "XArmOptions"]
