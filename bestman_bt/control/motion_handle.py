"""A handle over one motion of the hardware layer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from bestman_bt.control.handle import ControlHandle, ControlStatus
from bestman_bt.control.reading import READING_ERRORS
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus

Result = TypeVar("Result")


class MotionHandle(ControlHandle[Result]):
    """Ends as its motion does; ``result`` is read once, when the motion has succeeded."""

    def __init__(self, motion: Motion, result: Callable[[], Result] | None = None) -> None:
        super().__init__(motion.cancel)
        self._motion = motion
        self._read_result = result

    @property
    def status(self) -> ControlStatus:
        """The present status."""
        self._follow_motion()
        return super().status

    @property
    def error(self) -> Failure | None:
        """Why it failed or was cancelled, else None."""
        self._follow_motion()
        return super().error

    @property
    def result(self) -> Result | None:
        """What it found out, once it has succeeded."""
        self._follow_motion()
        return super().result

    def _follow_motion(self) -> None:
        if self._status is not ControlStatus.RUNNING:
            return
        status = self._motion.status
        if status is MotionStatus.SUCCEEDED:
            self._result = self._read_result() if self._read_result is not None else None
            self._status = ControlStatus.SUCCEEDED
        elif status is not MotionStatus.RUNNING:
            self._error = self._motion.error or Failure(MotionErrorCode.FAULT, "the part gave no reason")
            failed = status is MotionStatus.FAILED
            self._status = ControlStatus.FAILED if failed else ControlStatus.CANCELED


def start_motion(command: Callable[[], Motion], result: Callable[[], Result] | None = None) -> ControlHandle[Result]:
    """Give a command and wrap its motion; a command that is refused becomes a handle that has failed."""
    try:
        return MotionHandle(command(), result)
    except (CommandRefusedError, *READING_ERRORS) as error:
        refused: ControlHandle[Result] = ControlHandle()
        read = isinstance(error, READING_ERRORS)
        refused.fail(MotionErrorCode.DISCONNECTED if read else MotionErrorCode.REFUSED, str(error))
        return refused
