"""The handle of a running process: a motion of a part, an action of a controller, a computation."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Generic, TypeVar

from bestman_bt.messages import Failure, MotionErrorCode

Result = TypeVar("Result")


class MotionStatus(Enum):
    """The status of a motion."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class Motion(Generic[Result]):
    """An asynchronous command or computation; a final status never changes again.

    ``status``, ``done``, ``result``, ``failure`` and ``cancel`` are for the caller; ``succeed``, ``fail``, ``abort``
    and ``end`` for the implementation, from any thread. ``part``: the moving part, named in failures. ``on_cancel``:
    brings the part to rest within its deceleration limit; called at most once, when the motion already counts as
    cancelled.
    """

    def __init__(self, part: str = "", on_cancel: Callable[[], None] | None = None) -> None:
        self._part, self._on_cancel = part, on_cancel
        self._lock = threading.Lock()
        self._status = MotionStatus.RUNNING
        self._result: Result | None = None
        self._failure: Failure | None = None

    @property
    def status(self) -> MotionStatus:
        """The current status."""
        if self._status is MotionStatus.RUNNING:
            self._look()
        return self._status

    @property
    def done(self) -> bool:
        """Return whether the motion has ended, with any status."""
        return self.status is not MotionStatus.RUNNING

    @property
    def result(self) -> Result | None:
        """The result after the end, or None if there is none."""
        return self._result if self.done else None

    @property
    def failure(self) -> Failure | None:
        """The reason why it failed or was cancelled, else None."""
        return self._failure if self.done else None

    def cancel(self) -> None:
        """Cancel the motion and bring the part to rest; has no effect after the end."""
        failure = Failure(MotionErrorCode.CANCELED, "cancelled by its caller")
        if not self.done and self.end(MotionStatus.CANCELED, failure) and self._on_cancel is not None:
            self._on_cancel()

    def succeed(self, result: Result | None = None) -> None:
        """Mark the motion as succeeded."""
        self.end(MotionStatus.SUCCEEDED, None, result)

    def fail(self, code: MotionErrorCode, text: str, result: Result | None = None) -> None:
        """Mark the motion as failed; ``result``: measurements up to the failure."""
        self.end(MotionStatus.FAILED, Failure(code, text), result)

    def abort(self, code: MotionErrorCode, text: str) -> None:
        """Mark the motion as cancelled: by request, a stop or a newer command."""
        self.end(MotionStatus.CANCELED, Failure(code, text))

    def end(self, status: MotionStatus, failure: Failure | None, result: Result | None = None) -> bool:
        """End the motion unless it has ended; return whether this call ended it. A failure without a part gets this
        part.
        """
        if status is not MotionStatus.SUCCEEDED:
            failure = failure or Failure(MotionErrorCode.FAULT, "the part gave no reason")
            failure = failure if failure.part else replace(failure, part=self._part)
        with self._lock:
            if self._status is not MotionStatus.RUNNING:
                return False
            self._result, self._failure = result, failure
            self._status = status
            return True

    def _look(self) -> None:
        """Hook for motions carried out elsewhere: call ``end`` if the process has ended. Called while the motion is
        running.
        """
