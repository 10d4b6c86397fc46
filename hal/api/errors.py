"""Errors of the Robotics API; ``code`` is for programs, the message for people."""

from __future__ import annotations

from bestman_bt.errors import RobotError


class NotConnectedError(RobotError):
    """A part was used before ``connect()`` or after ``disconnect()``."""

    code = "disconnected"


class NoDataError(RobotError):
    """A sensor did not deliver: it is switched off, unplugged or silent."""

    code = "no_data"


class CommandRefusedError(RobotError, ValueError):
    """A command was refused and nothing moves: it is malformed, beyond a limit, or the robot is stopped."""

    code = "refused"


class UnknownPartError(RobotError, LookupError):
    """The robot has no part of that name or type."""
