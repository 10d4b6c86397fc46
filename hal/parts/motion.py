"""Motions that a part begins and ends."""

from __future__ import annotations

import threading
from typing import Protocol

from hal.api import Failure, Motion, MotionErrorCode, MotionStatus


class MotionOwner(Protocol):
    """A part that can bring its present motion to rest."""

    def brake(self) -> None:
        """Come to rest within the deceleration limits."""


class PartMotion(Motion):
    """A motion of one part; the part ends it, once, from whichever thread."""

    def __init__(self, owner: MotionOwner) -> None:
        self._owner = owner
        self._lock = threading.Lock()
        self._status = MotionStatus.RUNNING
        self._error: Failure | None = None

    @property
    def status(self) -> MotionStatus:
        """The present status."""
        return self._status

    @property
    def error(self) -> Failure | None:
        """Why it failed or was cancelled."""
        return self._error

    def cancel(self) -> None:
        """End it now; its part then brakes to rest."""
        if self._status is MotionStatus.RUNNING:
            self._owner.brake()
            self.end(MotionStatus.CANCELED, Failure(MotionErrorCode.CANCELED, "cancelled by its caller"))

    def succeed(self) -> None:
        """The target is reached."""
        with self._lock:
            if self._status is MotionStatus.RUNNING:
                self._status = MotionStatus.SUCCEEDED

    def end(self, status: MotionStatus, failure: Failure) -> None:
        """End without success; without effect on a motion that has ended."""
        with self._lock:
            if self._status is MotionStatus.RUNNING:
                self._error = failure
                self._status = status
