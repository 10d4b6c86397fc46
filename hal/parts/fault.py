"""What a controller reports when something is wrong."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.errors import InputError
from hal.api import MotionErrorCode, RobotError


@dataclass(frozen=True)
class Fault:
    """``code`` for programs, ``text`` for people; ``vendor_code``: the vendor's own, for example ``C31``."""

    code: MotionErrorCode
    text: str
    vendor_code: str = ""

    def __str__(self) -> str:
        """In words, with the vendor's code."""
        return f"{self.text} ({self.vendor_code})" if self.vendor_code else self.text


class ConnectionFailedError(RobotError, InputError):
    """A controller could not be reached, refused the connection, or its SDK is not installed."""
