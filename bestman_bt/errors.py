"""The base of all errors of this project, and its kinds: what a user wrote, the robot, an algorithm."""

from __future__ import annotations


class Error(Exception):
    """Base of all errors that bestman-bt raises on purpose. ``code`` is for programs, the message for people."""

    code: str = "failed"


class InputError(Error):
    """A file, an option or a name that a user gave cannot be used; on the command line exit code 2.

    The message, or each entry of ``problems`` where there are several faults, names file, line, field and value, and
    what would be right.
    """


class RobotError(Error):
    """The robot, one of its controllers or sensors does not do what was asked."""

    code = "fault"


class AlgorithmError(Error):
    """An algorithm got something that it cannot work with, or found no result."""


class WrongResultError(AlgorithmError):
    """A user's algorithm has returned what its interface does not allow; the message has its class, file and line."""

    code = "wrong_result"


class MissingExtraError(InputError, ImportError):
    """A package that is needed is not installed; the message names the extra that brings it."""

    code = "missing_extra"
