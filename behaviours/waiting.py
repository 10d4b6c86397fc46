"""Waiting for an action, but not for ever."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from behaviours.skill import Awaitable

if TYPE_CHECKING:
    from bestman_bt.control import ControlHandle


@dataclass(frozen=True)
class Until(Awaitable):
    """Waits for an action or until ``time`` by the clock ``now``, seconds, whatever comes first."""

    handle: ControlHandle[Any]
    now: Callable[[], float]
    time: float

    @property
    def done(self) -> bool:
        """Whether either has come."""
        return self.handle.done or self.now() >= self.time

    def cancel(self) -> None:
        """Cancel the action."""
        self.handle.cancel()
