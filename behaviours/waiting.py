"""Waiting for a condition, also while something moves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from behaviours.computation import TimeSource
from bestman_bt.control import Motion


class Until(Motion[None]):
    """Ends at the first look at which ``condition`` holds; with ``motion``, also when that has ended, however.

    The motion goes on where the condition holds first; to cancel the waiting is to cancel it.
    """

    def __init__(self, condition: Callable[[], bool], motion: Motion[Any] | None = None) -> None:
        super().__init__()
        self._condition, self._motion = condition, motion

    def cancel(self) -> None:
        """Cancel the motion, if any."""
        if self._motion is not None:
            self._motion.cancel()

    def _look(self) -> None:
        if (self._motion is not None and self._motion.done) or self._condition():
            self.succeed()


def passed(clock: TimeSource, duration: float) -> Callable[[], bool]:
    """A condition that holds from ``duration`` seconds after now on."""
    end = clock.now() + duration
    return lambda: clock.now() >= end
