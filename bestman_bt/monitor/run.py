"""A run shown by the monitor: executed now, or recorded in a folder."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from bestman_bt.errors import Error
from bestman_bt.records.history import RunHistory

TOLD = ("task", "tree", "scene", "robot", "seed", "pid", "folder", "started", "tick_rate", "clock", "source")


class RunError(Error):
    """A run cannot be read, or refuses a request; the message is for the user of the page."""


class MonitoredRun(ABC):
    """A run that the monitor shows; ``watchers`` are woken by changes. Everything runs in the server's event loop."""

    kind: str

    def __init__(self, identity: str) -> None:
        self.id = identity
        self.history = RunHistory()
        self.watchers: set[asyncio.Event] = set()

    @property
    @abstractmethod
    def state(self) -> str:
        """running, paused, ended, lost or interrupted."""

    @property
    def is_live(self) -> bool:
        """Return whether the run continues."""
        return self.state in ("running", "paused")

    def summary(self) -> dict[str, Any]:
        """Return the summary for lists of runs."""
        history = self.history
        fields = {key: history.about.get(key) for key in TOLD}
        return {
            "id": self.id,
            "kind": self.kind,
            **fields,
            "state": self.state,
            "outcome": history.end["outcome"] if history.end else None,
            "time": round(history.last, 3),
            "ticks": history.tick,
        }

    def wake_watchers(self) -> None:
        """Notify all viewers of changes."""
        for watcher in self.watchers:
            watcher.set()

    @abstractmethod
    async def open(self) -> None:
        """Load the run for a viewer. Raises RunError if it cannot be read."""

    @abstractmethod
    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Send a request to the executor and return its answer. Raises RunError if the executor refuses it."""

    @abstractmethod
    async def picture(self, number: int) -> bytes:
        """Return a picture as JPEG or PNG. Raises RunError if it is no longer available."""


def running_first(runs: Iterable[MonitoredRun]) -> list[MonitoredRun]:
    """Return the runs in the order of lists: running ones first, then newest first."""
    return sorted(runs, key=lambda run: (not run.is_live, -float(run.history.about.get("started") or 0), run.id))
