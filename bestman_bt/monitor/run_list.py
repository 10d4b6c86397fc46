"""All runs that the monitor knows: of the executors of this machine, as they come and go, and of run folders."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from bestman_bt.monitor.attached import AttachedRun
from bestman_bt.monitor.control_client import socket_folder
from bestman_bt.monitor.recorded import RecordedRun, identity_of, run_folders
from bestman_bt.monitor.run import MonitoredRun, running_first

LOOK_PERIOD = 0.5
"""Seconds between two looks for executors."""
FOLDER_PERIOD = 5.0
"""Seconds between two looks for new run folders."""
MAX_ENDED = 10
"""Live runs that are kept after their end, while nobody looks at them."""
MAX_LOADED = 6
"""Recorded runs whose history is held while nobody looks at them."""


class RunList:
    """``version`` grows with each change of the list; ``watchers`` are woken then."""

    def __init__(self, folders: Iterable[Path] = ()) -> None:
        self.version = 0
        self.watchers: set[asyncio.Event] = set()
        self._folders = [folder.absolute() for folder in folders]
        self._attached: dict[Path, AttachedRun] = {}
        self._ended: dict[str, AttachedRun] = {}
        self._recorded: dict[str, RecordedRun] = {}
        self._told: list[dict[str, Any]] = []
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Look once, then again and again."""
        await asyncio.to_thread(self._look_for_folders)
        self._look_for_executors()
        self._tasks = [asyncio.create_task(self._look()), asyncio.create_task(self._look_at_folders())]

    async def stop(self) -> None:
        """Follow nothing any more."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for run in [*self._attached.values(), *self._ended.values()]:
            await run.stop()

    def get(self, identity: str) -> MonitoredRun | None:
        """A run by its id."""
        return next((run for run in self._runs() if run.id == identity), None)

    def summaries(self) -> list[dict[str, Any]]:
        """What lists show."""
        return [run.summary() for run in running_first(self._runs())]

    @property
    def is_idle(self) -> bool:
        """Whether no executor runs and nobody looks."""
        return not self.watchers and not any(run.is_live for run in self._attached.values())

    def _runs(self) -> list[MonitoredRun]:
        live = [run for run in self._attached.values() if run.history.about]
        live += self._ended.values()
        folders = {run.history.about.get("folder") for run in live}
        recorded = [run for run in self._recorded.values() if str(run.folder) not in folders]
        return [*live, *recorded]

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_PERIOD)
            self._look_for_executors()
            await self._forget()
            self._tell_changes()

    async def _look_at_folders(self) -> None:
        while True:
            await asyncio.sleep(FOLDER_PERIOD)
            await asyncio.to_thread(self._look_for_folders)

    def _look_for_executors(self) -> None:
        for socket in sorted(socket_folder().glob("*.sock")):
            if socket not in self._attached:
                run = AttachedRun(self._free_name(socket.stem), socket)
                self._attached[socket] = run
                run.start()
        for socket, run in list(self._attached.items()):
            if run.is_over:
                del self._attached[socket]
                if run.history.about:
                    self._ended[run.id] = run

    def _free_name(self, stem: str) -> str:
        """Numbers of processes come again."""
        name, number = stem, 1
        while name in self._ended:
            number += 1
            name = f"{stem}-{number}"
        return name

    def _look_for_folders(self) -> None:
        known = {run.folder for run in self._recorded.values()}
        for given in self._folders:
            for folder in run_folders(given):
                if folder not in known:
                    run = RecordedRun(identity_of(folder), folder)
                    run.look()
                    self._recorded[run.id] = run

    async def _forget(self) -> None:
        unseen = [run for run in self._ended.values() if not run.watchers]
        for run in unseen[: max(0, len(self._ended) - MAX_ENDED)]:
            del self._ended[run.id]
            with contextlib.suppress(OSError):
                await run.stop()
        loaded = [run for run in self._recorded.values() if run.is_loaded and not run.watchers]
        for recorded in sorted(loaded, key=lambda run: run.opened)[: max(0, len(loaded) - MAX_LOADED)]:
            recorded.unload()

    def _tell_changes(self) -> None:
        told = self.summaries()
        if told != self._told:
            self._told = told
            self.version += 1
            for watcher in self.watchers:
                watcher.set()
