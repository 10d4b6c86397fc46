"""A run of an executor of this machine, followed through its control socket."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from bestman_bt.monitor.recorded import read_run
from bestman_bt.monitor.run import MonitoredRun, RunError
from bestman_bt.records.events import Event, EventError, ImageEvent, RunEvent, Topic, from_line

LONGEST_LINE = 16 << 20
"""Bytes of one event."""
FOLLOWED: tuple[Topic, ...] = ("states", "blackboard", "robot", "scan", "log")
RETRY = 0.5
"""Seconds between attempts to reach an executor whose connection broke."""
REFUSALS = 2
"""So many attempts in a row that nobody listens to: a new executor makes its socket a moment before it listens."""
ANSWER_WAIT = 5.0
LOOK_AGAIN = 1.0
"""Seconds without an event after which it is looked whether anybody still wants them."""
FROZEN = 3.0
"""Seconds to wait for an executor that accepts a connection."""
Take = Callable[[Event], None]


class AttachedRun(MonitoredRun):
    """Follows from ``start`` until the executor's end; pictures only while somebody has the run open."""

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
        """As the executor told last; lost where it went away without a word."""
        if self.history.end is not None:
            return "ended"
        if self.is_lost:
            return "lost"
        return "paused" if self.history.paused is not None else "running"

    def start(self) -> None:
        """Begin to follow."""
        self._tasks.append(asyncio.create_task(self._follow(), name=f"follow {self.id}"))

    async def stop(self) -> None:
        """Follow no more."""
        tasks = [*self._tasks, *([self._pictures] if self._pictures is not None else [])]
        for task in tasks:
            task.cancel()
        for task in tasks:
            with contextlib.suppress(asyncio.CancelledError):
                await task

    async def open(self) -> None:
        """Have the executor send pictures from now on, until nobody looks any more."""
        if (self._pictures is None or self._pictures.done()) and not self.is_over:
            self._pictures = asyncio.create_task(self._follow_pictures(), name=f"pictures {self.id}")

    async def request(self, message: dict[str, Any]) -> dict[str, Any]:
        """Send one request on a connection of its own, so that a stop waits for nothing."""
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
        """A picture that is still held in memory."""
        found = self.history.picture(number)
        if found is None:
            raise RunError("this picture is not held any more")
        return found.jpeg

    @property
    def is_over(self) -> bool:
        """Whether nothing more will come."""
        return self.history.end is not None or self.is_lost

    async def _follow(self) -> None:
        """Read events until the end; where the connection breaks and somebody still listens, begin anew.

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
                self.socket.unlink()
        self.is_lost = self.history.end is None
        self.wake_watchers()

    async def _catch_up(self) -> None:
        """Read what the run has recorded before we came; without a folder, its past is not known."""
        told: list[RunEvent] = []

        def take(event: Event) -> None:
            if isinstance(event, RunEvent):
                told.append(event)

        await self._read((), take, lambda: not told)
        if not told or not told[0].folder:
            return
        try:
            self.history = await asyncio.to_thread(read_run, Path(told[0].folder))
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
        """Subscribe, and take events until the executor ends the connection or we do not go on."""
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
