"""Motions of parts as controllers hand them out: with a result, and refused ones as motions that have failed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

from bestman_bt.control.joint_state import READING_ERRORS
from hal.api import CommandRefusedError, Motion, MotionErrorCode, MotionStatus

Result = TypeVar("Result")


class ControlledMotion(Motion[Result]):
    """Ends as the part's ``motion`` does, or earlier if a controller fails it; ``read`` then reads its result."""

    def __init__(self, part: str, motion: Motion[Any], read: Callable[[], Result] | None = None) -> None:
        super().__init__(part, motion.cancel)
        self._motion, self._read = motion, read

    def _look(self) -> None:
        motion = self._motion
        if motion.done:
            succeeded = motion.status is MotionStatus.SUCCEEDED
            result = self._read() if succeeded and self._read is not None else None
            self.end(motion.status, motion.failure, result)


def start_motion(
    part: str, command: Callable[[], Motion[Any]], read: Callable[[], Result] | None = None
) -> Motion[Result]:
    """Return the motion that ``command`` starts; a refused command gives a failed motion."""
    try:
        return ControlledMotion(part, command(), read)
    except CommandRefusedError as error:
        failure = error.failure
    except READING_ERRORS as error:
        failure = replace(error.failure, code=MotionErrorCode.DISCONNECTED)
    refused: Motion[Result] = Motion(part)
    refused.end(MotionStatus.FAILED, failure)
    return refused
