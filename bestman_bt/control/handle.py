"""Handles of control actions that are under way; skills poll them and may cancel them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Generic, TypeVar

from bestman_bt.control.joint_state import READING_ERRORS
from hal.api import CommandRefusedError, Failure, Motion, MotionErrorCode, MotionStatus

Result = TypeVar("Result")


class ControlStatus(Enum):
    """Where an action stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class ControlHandle(Generic[Result]):
    """An action that goes on by itself while the clock runs; a final status never changes again.

    ``status``, ``error``, ``result`` and ``cancel`` are for the one who asked; ``succeed``, ``fail`` and ``abort``
    are for the controller. ``part``: the one that acts, which failures name. ``on_cancel`` brings it to rest; it is
    called at most once.
    """

    def __init__(self, part: str = "", on_cancel: Callable[[], None] | None = None) -> None:
        self._part = part
        self._status = ControlStatus.RUNNING
        self._error: Failure | None = None
        self._result: Result | None = None
        self._on_cancel = on_cancel

    @property
    def status(self) -> ControlStatus:
        """The present status."""
        return self._status

    @property
    def error(self) -> Failure | None:
        """Why it failed or was cancelled, else None."""
        return self._error

    @property
    def result(self) -> Result | None:
        """What it found out, once it has ended; None where there is nothing to say."""
        return self._result

    @property
    def done(self) -> bool:
        """Whether the action has ended, well or not."""
        return self.status is not ControlStatus.RUNNING

    def cancel(self) -> None:
        """Bring the part to rest; without effect on an action that has ended."""
        if not self.done:
            self.abort(MotionErrorCode.CANCELED, "canceled on request")
            if self._on_cancel is not None:
                self._on_cancel()

    def succeed(self, result: Result | None = None) -> None:
        """End well."""
        if not self.done:
            self._result = result
            self._status = ControlStatus.SUCCEEDED

    def fail(self, code: MotionErrorCode, text: str, result: Result | None = None) -> None:
        """End as failed; ``result``: what was found out nevertheless."""
        if not self.done:
            self._result = result
            self._error = Failure(code, text, self._part)
            self._status = ControlStatus.FAILED

    def abort(self, code: MotionErrorCode, text: str) -> None:
        """End as cancelled: by request, a stop or a newer command."""
        if not self.done:
            self._error = Failure(code, text, self._part)
            self._status = ControlStatus.CANCELED


class MotionHandle(ControlHandle[Result]):
    """Ends as its motion does; ``result`` is read once, when the motion has succeeded."""

    def __init__(self, part: str, motion: Motion, result: Callable[[], Result] | None = None) -> None:
        super().__init__(part, motion.cancel)
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
            error = self._motion.error or Failure(MotionErrorCode.FAULT, "the part gave no reason")
            self._error = error if error.part else replace(error, part=self._part)
            failed = status is MotionStatus.FAILED
            self._status = ControlStatus.FAILED if failed else ControlStatus.CANCELED


def start_motion(
    part: str, command: Callable[[], Motion], result: Callable[[], Result] | None = None
) -> ControlHandle[Result]:
    """Give a command to a part and wrap its motion; a command that is refused becomes a handle that has failed."""
    try:
        return MotionHandle(part, command(), result)
    except (CommandRefusedError, *READING_ERRORS) as error:
        refused: ControlHandle[Result] = ControlHandle(part)
        read = isinstance(error, READING_ERRORS)
        refused.fail(MotionErrorCode.DISCONNECTED if read else MotionErrorCode.REFUSED, str(error))
        return refused
