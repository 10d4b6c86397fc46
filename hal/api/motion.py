"""Handles of motions that are under way."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import Enum


class MotionStatus(Enum):
    """Where a motion stands."""

    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELED = "canceled"


class MotionErrorCode(Enum):
    """Why a motion failed or was cancelled."""

    STOPPED = "stopped"  # Robot.stop() or the part's stop()
    SUPERSEDED = "superseded"  # a newer command took the part over
    TRACKING = "tracking"  # the part did not follow within its tolerance
    TIMEOUT = "timeout"  # the target was not reached in time
    COLLISION = "collision"  # the controller reports a collision or a protective stop
    DISCONNECTED = "disconnected"
    FAULT = "fault"  # any other fault of the part


@dataclass(frozen=True)
class MotionError:
    """The code for programs, the text for people."""

    code: MotionErrorCode
    text: str


class Motion(ABC):
    """A motion that was commanded; it goes on by itself while the clock runs."""

    @property
    @abstractmethod
    def status(self) -> MotionStatus:
        """The present status; a final one never changes again."""

    @property
    @abstractmethod
    def error(self) -> MotionError | None:
        """Why it failed or was cancelled, else None."""

    @abstractmethod
    def cancel(self) -> None:
        """Bring the part to rest within its deceleration limit; without effect on a motion that has ended."""

    @property
    def done(self) -> bool:
        """Whether the motion has ended, well or not."""
        return self.status is not MotionStatus.RUNNING
