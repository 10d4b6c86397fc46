"""A run that the monitor shows: one that an executor carries out now, or one that a folder recorded."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any

from bestman_bt.errors import Error
from bestman_bt.records.history import RunHistory

TOLD = ("task", "tree", "scene", "robot", "seed", "pid", "folder", "started", "tick_rate", "clock", "source")


class RunError(Error):
    """A run cannot be read or does not obey; the words are for the person at the page."""


class MonitoredRun(ABC):
    """``watchers`` are woken when there is something new; all of it happens in the server's event loop."""

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
        """Whether it goes on."""
        return self.state in ("running", "paused")

    def summary(self) -> dict[str, Any]:
        """What lists of runs tell of it."""
        history = self.history
        told = {key: history.about.get(key) for key in TOLD}
        return {
            "id": self.id,
            "kind": self.kind,
            **told,
            "state": self.state,
            "outcome": history.end["outcome"] if history.end else None,
            "time": round(history.last, 3),
            "ticks": history.tick,
        }

    def wake_watchers(self) -> None:
        """Tell all viewers that there is something new."""
        for watcher in self.watchers:
            watcher.set()

    @abstractmethod
    async def open(self) -> None:
        """Somebody wants to look at it; raises RunError where it cannot be read."""

    @abstractmethod
    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Ask its executor for something; raises RunError where that is refused."""

    @abstractmethod
    async def picture(self, number: int) -> bytes:
        """Return a picture as JPEG or PNG; raises RunError where there is none any more."""


def running_first(runs: Iterable[MonitoredRun]) -> list[MonitoredRun]:
    """Return the order in which lists show runs: those that go on, then the newest."""
    return sorted(runs, key=lambda run: (not run.is_live, -float(run.history.about.get("started") or 0), run.id))
