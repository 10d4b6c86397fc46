"""Threads and processes that a session should not leave behind."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path


def descendants() -> dict[int, str]:
    """Processes below this one that still run: number → how they were started."""
    parents: dict[int, int] = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if fields[0] != "Z":
                parents[int(folder.name)] = int(fields[1])
    below, found = {os.getpid()}, set[int]()
    while below:
        below = {number for number, parent in parents.items() if parent in below}
        found |= below
    return {number: _command(number) for number in found}


class LeftBehind:
    """What has begun since this was made; processes count although they lost their parents, once ``note`` saw them."""

    def __init__(self) -> None:
        self._threads = set(threading.enumerate())
        self._processes = set(descendants())
        self._seen: dict[int, str] = {}

    def note(self) -> None:
        """Look which processes there are now."""
        self._seen |= {number: command for number, command in descendants().items() if number not in self._processes}

    def after(self, grace: float) -> list[str]:
        """What still runs when ``grace`` seconds are over; empty as soon as nothing does."""
        deadline = time.monotonic() + grace
        while (left := self._now()) and time.monotonic() < deadline:
            time.sleep(0.05)
        return left

    def _now(self) -> list[str]:
        self.note()
        threads = [thread.name for thread in threading.enumerate() if thread not in self._threads]
        return threads + [f"{number} {line}" for number, line in self._seen.items() if _command(number) == line]


def _command(number: int) -> str:
    """Empty for a process that has ended."""
    try:
        return Path(f"/proc/{number}/cmdline").read_bytes().replace(b"\0", b" ").decode().strip()
    except OSError:
        return ""
