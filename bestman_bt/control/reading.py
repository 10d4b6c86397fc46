"""What reading a robot may raise, for those that may not know the hardware layer."""

from __future__ import annotations

from bestman_bt.sensing.joint_state import JointStateError
from hal.api import NoDataError, NotConnectedError

READING_ERRORS = (NotConnectedError, NoDataError, JointStateError)
"""The robot or one of its controllers is gone, or a sensor is silent; ``code`` tells which."""
