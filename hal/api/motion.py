"""Handles of motions that are under way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum

from bestman_bt.messages import Failure


class MotionStatus(Enum):
    """Where a motion stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class Motion(ABC):
    """A motion that was commanded; it goes on by itself while the clock runs."""

    @property
    @abstractmethod
    def status(self) -> MotionStatus:
        """The present status; a final one never changes again."""

    @property
    @abstractmethod
    def error(self) -> Failure | None:
        """Why it failed or was cancelled, else None."""

    @abstractmethod
    def cancel(self) -> None:
        """Bring the part to rest within its deceleration limit; without effect on a motion that has ended."""

    @property
    def done(self) -> bool:
        """Whether the motion has ended, well or not."""
        return self.status is not MotionStatus.RUNNING
