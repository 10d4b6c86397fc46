"""What reading a robot may raise, for those that may not know the hardware layer."""

from __future__ import annotations

from hal.api import NoDataError, NotConnectedError

READING_ERRORS = (NotConnectedError, NoDataError)
"""The robot is gone, or a sensor is silent; ``code`` tells which."""
