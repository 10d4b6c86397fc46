"""A controller that cannot be connected."""

from __future__ import annotations

from bestman_bt.errors import InputError
from hal.api import RobotError


class ConnectionFailedError(RobotError, InputError):
    """A controller could not be reached, refused the connection, or its SDK is not installed."""
