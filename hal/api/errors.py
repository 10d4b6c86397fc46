"""Errors of the Robotics API; ``code`` is for programs, the message for people."""

from __future__ import annotations

from typing import ClassVar


class RobotError(Exception):
    """Base of all errors that a robot implementation raises."""

    code: ClassVar[str] = "fault"


class NotConnectedError(RobotError):
    """A part was used before ``connect()`` or after ``disconnect()``."""

    code: ClassVar[str] = "disconnected"


class NoDataError(RobotError):
    """A sensor did not deliver: it is switched off, unplugged or silent."""

    code: ClassVar[str] = "no_data"


class CommandRefusedError(RobotError, ValueError):
    """A command was refused and nothing moves: it is malformed, beyond a limit, or the robot is stopped."""

    code: ClassVar[str] = "refused"


class UnknownPartError(RobotError, LookupError):
    """The robot has no part of that name or type."""
