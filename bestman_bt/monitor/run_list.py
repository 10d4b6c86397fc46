"""All runs shown by the monitor: the current executors of this machine, and run folders."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from bestman_bt.monitor.control_client import remove_socket, socket_folder
from bestman_bt.monitor.recorded import RecordedRun, identity_of, read_run
from bestman_bt.monitor.run import MonitoredRun, RunError, running_first
from bestman_bt.records.events import Event, EventError, ImageEvent, RunEvent, Topic, from_line
from bestman_bt.records.reader import run_folders

LONGEST_LINE = 16 << 20
"""Bytes of one event."""
FOLLOWED: tuple[Topic, ...] = ("states", "blackboard", "robot", "scan", "log")
RETRY = 0.5
"""Seconds between attempts to reach an executor whose connection broke."""
REFUSALS = 2
"""Number of consecutive refused connections: a new executor creates its socket a moment before it listens."""
ANSWER_WAIT = 5.0
LOOK_AGAIN = 1.0
"""Seconds without an event after which the connection checks that its viewers are still connected."""
FROZEN = 3.0
"""Seconds to wait for an executor that accepts a connection."""
Take = Callable[[Event], None]


class AttachedRun(MonitoredRun):
    """A live run, followed from ``start`` to the executor's end; pictures are sent only while a page shows the run."""

    kind = "live"

    def __init__(self, identity: str, socket: Path) -> None:
        super().__init__(identity)
        self.socket = socket
        self.fault = ""
        self.is_lost = False
        self._tasks: list[asyncio.Task[None]] = []
        self._pictures: asyncio.Task[None] | None = None

    @property
    def state(self) -> str:
        """Return the last reported state; ``lost`` if the executor disappeared without an end."""
        if self.history.end is not None:
            return "ended"
        if self.is_lost:
            return "lost"
        return "paused" if self.history.paused is not None else "running"

    def start(self) -> None:
        """Start to follow the executor."""
        self._tasks.append(asyncio.create_task(self._follow(), name=f"follow {self.id}"))

    async def stop(self) -> None:
        """Stop following the run."""
        tasks = [*self._tasks, *([self._pictures] if self._pictures is not None else [])]
        for task in tasks:
            task.cancel()
        for task in tasks:
            with contextlib.suppress(asyncio.CancelledError):
                await task

    async def open(self) -> None:
        """Request pictures from the executor while a page shows the run."""
        if (self._pictures is None or self._pictures.done()) and not self.is_over:
            self._pictures = asyncio.create_task(self._follow_pictures(), name=f"pictures {self.id}")

    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Send one request on a separate connection, so that a stop does not wait."""
        if self.is_over:
            raise RunError("the run is over")
        try:
            async with asyncio.timeout(ANSWER_WAIT):
                reader, writer = await asyncio.open_unix_connection(str(self.socket), limit=LONGEST_LINE)
                try:
                    writer.write(json.dumps(message).encode() + b"\n")
                    await writer.drain()
                    answer = json.loads(await reader.readline())
                finally:
                    writer.close()
        except TimeoutError as error:
            raise RunError("the executor does not answer") from error
        except (OSError, ValueError, RecursionError) as error:
            raise RunError(f"the executor cannot be reached: {error}") from error
        if not isinstance(answer, dict) or not answer.get("ok"):
            why = answer.get("error") if isinstance(answer, dict) else None
            raise RunError(str(why or "the executor has refused"))
        return answer

    async def picture(self, number: int) -> bytes:
        """Return a picture that is still held in memory."""
        found = self.history.picture(number)
        if found is None:
            raise RunError("this picture has been dropped")
        return found.jpeg

    @property
    def is_over(self) -> bool:
        """Return whether no further events can arrive."""
        return self.history.end is not None or self.is_lost

    async def _follow(self) -> None:
        """Read events until the end; where the connection breaks and a viewer is still there, reconnect.

        A process that was killed leaves its socket behind: it is removed.
        """
        refusals = 0
        while refusals < REFUSALS:
            try:
                if not self.history.about:
                    await self._catch_up()
                await self._read(FOLLOWED, self._take, lambda: True)
                refusals = 0
            except (OSError, TimeoutError) as error:
                self.fault = str(error)
                refusals = refusals + 1 if isinstance(error, ConnectionRefusedError) else 0
            if self.history.end is not None or not self.socket.exists():
                break
            await asyncio.sleep(RETRY)
        else:
            with contextlib.suppress(OSError):
                remove_socket(self.socket)
        self.is_lost = self.history.end is None
        self.wake_watchers()

    async def _catch_up(self) -> None:
        """Read what the run has recorded before we came; without a folder, its past is not known."""
        received: list[RunEvent] = []

        def take(event: Event) -> None:
            if isinstance(event, RunEvent):
                received.append(event)

        await self._read((), take, lambda: not received)
        if not received or not received[0].folder:
            return
        try:
            self.history = await asyncio.to_thread(read_run, Path(received[0].folder))
        except RunError as error:
            self.fault = str(error)

    async def _follow_pictures(self) -> None:
        def take(event: Event) -> None:
            if isinstance(event, ImageEvent):
                self._take(event)

        while self.watchers and not self.is_over:
            with contextlib.suppress(OSError, TimeoutError):
                await self._read(("images",), take, lambda: bool(self.watchers))
            await asyncio.sleep(RETRY)

    async def _read(self, topics: tuple[Topic, ...], take: Take, goes_on: Callable[[], bool]) -> None:
        """Subscribe, and process events until the executor closes the connection or the list is stopped."""
        async with asyncio.timeout(FROZEN):
            reader, writer = await asyncio.open_unix_connection(str(self.socket), limit=LONGEST_LINE)
        try:
            writer.write(json.dumps({"do": "subscribe", "topics": list(topics)}).encode() + b"\n")
            while goes_on():
                try:
                    async with asyncio.timeout(LOOK_AGAIN):
                        line = await reader.readline()
                except TimeoutError:
                    continue
                except ValueError:  # longer than LONGEST_LINE: what is left of it is read as a damaged event
                    self.fault = f"an event of more than {LONGEST_LINE} bytes"
                    continue
                if not line:
                    return
                self._take_line(line, take)
                await asyncio.sleep(0)  # lines that have come already would keep the server from all else
        finally:
            writer.close()

    def _take_line(self, line: bytes, take: Take) -> None:
        if line.startswith(b'{"ok"'):  # the answer to ``subscribe``
            return
        try:
            take(from_line(line))
        except EventError as error:
            self.fault = str(error)

    def _take(self, event: Event) -> None:
        self.history.take(event)
        self.wake_watchers()


LOOK_PERIOD = 0.5
"""Seconds between two searches for executors."""
FOLDER_PERIOD = 5.0
"""Seconds between two searches for new run folders."""
MAX_ENDED = 10
"""Number of live runs kept after their end without viewers."""
MAX_LOADED = 6
"""Number of recorded runs whose history is kept without viewers."""


class RunList:
    """The known runs. Each change increases ``version`` and wakes ``watchers``."""

    def __init__(self, folders: Iterable[Path] = ()) -> None:
        self.version = 0
        self.watchers: set[asyncio.Event] = set()
        self._folders = [folder.absolute() for folder in folders]
        self._attached: dict[Path, AttachedRun] = {}
        self._ended: dict[str, AttachedRun] = {}
        self._recorded: dict[str, RecordedRun] = {}
        self._newest: tuple[int, list[dict[str, Any]]] = (0, [])
        self._tasks: list[asyncio.Task[None]] = []

    async def start(self) -> None:
        """Search for runs now, then periodically."""
        await self._look_for_folders()
        self._look_for_executors()
        self._tasks = [asyncio.create_task(self._look()), asyncio.create_task(self._look_at_folders())]

    async def stop(self) -> None:
        """Stop following all runs."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        for run in [*self._attached.values(), *self._ended.values()]:
            await run.stop()

    def get(self, identity: str) -> MonitoredRun | None:
        """Return a run by its id."""
        return next((run for run in self._runs() if run.id == identity), None)

    def summaries(self) -> list[dict[str, Any]]:
        """Return the summaries of all runs."""
        return [run.summary() for run in running_first(self._runs())]

    @property
    def is_idle(self) -> bool:
        """Return whether no executor runs and no page is open."""
        return not self.watchers and not any(run.is_live for run in self._attached.values())

    def _followed(self) -> list[AttachedRun]:
        return [*(run for run in self._attached.values() if run.history.about), *self._ended.values()]

    def _loaded(self) -> list[RecordedRun]:
        return [run for run in self._recorded.values() if run.is_loaded]

    def _runs(self) -> list[MonitoredRun]:
        live = self._followed()
        folders = {run.history.about.get("folder") for run in live}
        recorded = [run for run in self._recorded.values() if str(run.folder) not in folders]
        return [*live, *recorded]

    async def _look(self) -> None:
        while True:
            await asyncio.sleep(LOOK_PERIOD)
            self._look_for_executors()
            await self._forget()
            self._notify_changes()

    async def _look_at_folders(self) -> None:
        while True:
            await asyncio.sleep(FOLDER_PERIOD)
            await self._look_for_folders()

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
        """Return an unused name, since process numbers are reused."""
        name, number = stem, 1
        while name in self._ended:
            number += 1
            name = f"{stem}-{number}"
        return name

    async def _look_for_folders(self) -> None:
        found = await asyncio.to_thread(self._new_recorded, {str(run.folder) for run in self._recorded.values()})
        self._recorded.update((run.id, run) for run in found)

    def _new_recorded(self, known: set[str]) -> list[RecordedRun]:
        folders = [folder for given in self._folders for folder in run_folders(given, known=known)]
        found = [RecordedRun(identity_of(folder), folder) for folder in dict.fromkeys(folders)]
        for run in found:
            run.look()
        return found

    async def _forget(self) -> None:
        unseen = [run for run in self._ended.values() if not run.watchers]
        for run in unseen[: max(0, len(self._ended) - MAX_ENDED)]:
            del self._ended[run.id]
            with contextlib.suppress(OSError):
                await run.stop()
        loaded = [run for run in self._loaded() if not run.watchers]
        for recorded in sorted(loaded, key=lambda run: run.opened)[: max(0, len(loaded) - MAX_LOADED)]:
            recorded.unload()

    def _notify_changes(self) -> None:
        """Notify pages of a changed list; the summary of a recorded run changes only while it is loaded."""
        newest = (len(self._recorded), [run.summary() for run in (*self._followed(), *self._loaded())])
        if newest != self._newest:
            self._newest = newest
            self.version += 1
            for watcher in self.watchers:
                watcher.set()
