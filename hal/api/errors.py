"""Errors of the Robotics API; ``code`` is for programs, the message for people."""

from __future__ import annotations

from bestman_bt.errors import RobotError
from bestman_bt.messages import Failure, MotionErrorCode


class PartError(RobotError):
    """A part failed to execute a request; ``failure``: the record for motions and reports."""

    code: str = MotionErrorCode.FAULT

    def __init__(self, text: str, part: str = "", vendor_code: str = "") -> None:
        super().__init__(text)
        self.failure = Failure(self.code, text, part, vendor_code)


class NotConnectedError(PartError):
    """A part was used before ``connect()`` or after ``disconnect()``."""

    code = MotionErrorCode.DISCONNECTED


class NoDataError(PartError):
    """A sensor delivers no data: it is switched off, unplugged or silent."""

    code = MotionErrorCode.NO_DATA


class CommandRefusedError(PartError, ValueError):
    """Raised if a command is refused: it is malformed, beyond a limit, or the robot is stopped. Nothing moves."""

    code = MotionErrorCode.REFUSED


class RobotStoppedError(CommandRefusedError):
    """Raised if a command is refused because the robot is stopped; ``clear_stop()`` makes it accept commands again."""

    code = MotionErrorCode.STOPPED


class UnknownPartError(RobotError, LookupError):
    """The robot has no part of that name or type."""
