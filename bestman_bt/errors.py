"""Base class of all errors of this project, and its kinds: user input, robot, algorithm."""

from __future__ import annotations


class Error(Exception):
    """Base of all errors that bestman-bt raises deliberately. ``code``: for programs; the message: for people."""

    code: str = "failed"


class InputError(Error):
    """A file, option or name given by the user is invalid; on the command line, exit code 2.

    The message, or each entry of ``problems`` if there are several, names file, line, field, value and what is
    accepted.
    """


class RobotError(Error):
    """The robot, one of its controllers or one of its sensors failed to execute a request."""

    code = "fault"


class AlgorithmError(Error):
    """An algorithm received unusable input, or found no result."""


class WrongResultError(AlgorithmError):
    """A user's algorithm returned a value that its interface does not allow; the message gives class, file and line."""

    code = "wrong_result"


class MissingExtraError(InputError, ImportError):
    """A required package is not installed; the message names the extra that provides it."""

    code = "missing_extra"
