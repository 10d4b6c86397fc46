"""Universal Robots through ur-rtde (extra ``ur``), which runs in a process of its own while connected."""

from hal.ur.arm import URArm
from hal.ur.connection import URConnection, URDigitalIO, URForceTorque, UROptions

__all__ = ["URArm", "URConnection", "URDigitalIO", "URForceTorque", "UROptions"]
