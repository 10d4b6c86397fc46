"""Universal Robots through ur-rtde (extra ``ur``), which runs in a process of its own while connected."""

from hal.ur.arm import URArm
from hal.ur.connection import URConnection, URForceTorque
from hal.ur.digital_io import URDigitalIO
from hal.ur.options import UROptions

__all__ = ["URArm", "URConnection", "URDigitalIO", "URForceTorque", "UROptions"]
