"""The one handle of what is under way: a motion of a part, an action of a controller, a computation."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Generic, TypeVar

from bestman_bt.messages import Failure, MotionErrorCode

Result = TypeVar("Result")


class MotionStatus(Enum):
    """Where a motion stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class Motion(Generic[Result]):
    """Something that goes on by itself while the clock runs; a final status never changes again.

    ``status``, ``done``, ``result``, ``failure`` and ``cancel`` are for the one who asked for it; ``succeed``,
    ``fail``, ``abort`` and ``end`` for the one who carries it out, from whichever thread. ``part``: the one that
    moves, which failures name. ``on_cancel`` brings it to rest within its deceleration limit; it is called once at
    most, when the motion already counts as cancelled.
    """

    def __init__(self, part: str = "", on_cancel: Callable[[], None] | None = None) -> None:
        self._part, self._on_cancel = part, on_cancel
        self._lock = threading.Lock()
        self._status = MotionStatus.RUNNING
        self._result: Result | None = None
        self._failure: Failure | None = None

    @property
    def status(self) -> MotionStatus:
        """The present status."""
        if self._status is MotionStatus.RUNNING:
            self._look()
        return self._status

    @property
    def done(self) -> bool:
        """Whether it has ended, well or not."""
        return self.status is not MotionStatus.RUNNING

    @property
    def result(self) -> Result | None:
        """What it found out, once it has ended; None where there is nothing to say."""
        return self._result if self.done else None

    @property
    def failure(self) -> Failure | None:
        """Why it failed or was cancelled, else None."""
        return self._failure if self.done else None

    def cancel(self) -> None:
        """Bring the part to rest; without effect on what has ended."""
        failure = Failure(MotionErrorCode.CANCELED, "cancelled by its caller")
        if not self.done and self.end(MotionStatus.CANCELED, failure) and self._on_cancel is not None:
            self._on_cancel()

    def succeed(self, result: Result | None = None) -> None:
        """The target is reached."""
        self.end(MotionStatus.SUCCEEDED, None, result)

    def fail(self, code: MotionErrorCode, text: str, result: Result | None = None) -> None:
        """The motion has failed; ``result``: what was measured nevertheless."""
        self.end(MotionStatus.FAILED, Failure(code, text), result)

    def abort(self, code: MotionErrorCode, text: str) -> None:
        """It was ended: by request, a stop or a newer command."""
        self.end(MotionStatus.CANCELED, Failure(code, text))

    def end(self, status: MotionStatus, failure: Failure | None, result: Result | None = None) -> bool:
        """End, unless it has ended; whether this did it. A failure that names no part is one of this part."""
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
        """For kinds of motions that somebody else carries out: ``end`` it if that has ended. Called while it runs."""
