"""Errors of the Robotics API."""

from __future__ import annotations


class RobotError(Exception):
    """Base of all errors that a robot implementation raises."""


class NotConnectedError(RobotError):
    """A part was used before ``connect()`` or after ``disconnect()``."""


class NoDataError(RobotError):
    """A sensor did not deliver: it is switched off, unplugged or silent."""


class CommandRefusedError(RobotError, ValueError):
    """A command was refused and nothing moves: it is malformed, beyond a limit, or the robot is stopped."""


class UnknownPartError(RobotError, LookupError):
    """The robot has no part of that name or type."""
