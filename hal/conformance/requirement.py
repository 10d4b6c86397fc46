"""The error of a failed check, and helpers to raise it."""

from __future__ import annotations

from collections.abc import Callable

from bestman_bt.errors import Error
from hal.api import RobotError


class ConformanceError(Error, AssertionError):
    """Raised if an implementation violates a requirement of the Robotics API."""


def require(holds: bool, sentence: str) -> None:
    """Raise ConformanceError with ``sentence`` unless ``holds``."""
    if not holds:
        raise ConformanceError(sentence)


def require_refusal(
    call: Callable[[], object], error: type[RobotError], what: str, words: tuple[str, ...] = ()
) -> None:
    """Require that ``call`` raises ``error`` with all ``words`` in its message."""
    try:
        call()
    except error as refusal:
        missing = [word for word in words if word not in str(refusal)]
        require(not missing, f"the message about {what} lacks {missing}: {refusal}")
        return
    raise ConformanceError(f"{what} should raise {error.__name__}")
