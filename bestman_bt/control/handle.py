"""Handles of control actions that are under way; skills poll them and may cancel them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, TypeVar

Result = TypeVar("Result")


class ControlStatus(Enum):
    """Where an action stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class ControlErrorCode(Enum):
    """Why an action failed or was cancelled."""

    STOPPED = "stopped"  # the robot or the part was stopped
    SUPERSEDED = "superseded"  # a newer command took the part over
    CANCELED = "canceled"  # the one who asked for it cancelled it
    REFUSED = "refused"  # the hardware layer refused the command; nothing moved
    TRACKING = "tracking"  # the part did not follow within its tolerance
    BLOCKED = "blocked"  # commanded to move, but it does not get on
    LOST = "lost"  # the robot does not know well enough where it is
    TOLERANCE = "tolerance"  # it came to rest too far from the goal
    UNREACHABLE = "unreachable"  # the target is beyond the part's limits
    GUARDED = "guarded"  # a guard objected: what was to hold during the action no longer does
    TIMEOUT = "timeout"
    COLLISION = "collision"
    DISCONNECTED = "disconnected"
    FAULT = "fault"  # any other fault of the part


@dataclass(frozen=True)
class ControlError:
    """The code for programs, the text for people."""

    code: ControlErrorCode
    text: str


class ControlHandle(Generic[Result]):
    """An action that goes on by itself while the clock runs; a final status never changes again.

    ``status``, ``error``, ``result`` and ``cancel`` are for the one who asked; ``succeed``, ``fail`` and ``abort``
    are for the controller. ``on_cancel`` brings the part to rest; it is called at most once.
    """

    def __init__(self, on_cancel: Callable[[], None] | None = None) -> None:
        self._status = ControlStatus.RUNNING
        self._error: ControlError | None = None
        self._result: Result | None = None
        self._on_cancel = on_cancel

    @property
    def status(self) -> ControlStatus:
        """The present status."""
        return self._status

    @property
    def error(self) -> ControlError | None:
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
            self.abort(ControlErrorCode.CANCELED, "canceled on request")
            if self._on_cancel is not None:
                self._on_cancel()

    def succeed(self, result: Result | None = None) -> None:
        """End well."""
        if not self.done:
            self._result = result
            self._status = ControlStatus.SUCCEEDED

    def fail(self, code: ControlErrorCode, text: str, result: Result | None = None) -> None:
        """End as failed; ``result``: what was found out nevertheless."""
        if not self.done:
            self._result = result
            self._error = ControlError(code, text)
            self._status = ControlStatus.FAILED

    def abort(self, code: ControlErrorCode, text: str) -> None:
        """End as cancelled: by request, a stop or a newer command."""
        if not self.done:
            self._error = ControlError(code, text)
            self._status = ControlStatus.CANCELED
