"""The one stop over all parts of a robot."""

from __future__ import annotations

import threading

from hal.api import CommandRefusedError


class StopLatch:
    """Set by ``Robot.stop()`` and by faults; while it is set, no part takes a command. Safe from any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._set = False
        self._why = ""
        self._stops = 0

    def __bool__(self) -> bool:
        """Whether the robot is stopped."""
        return self._set

    @property
    def why(self) -> str:
        """The fault that stopped the robot; empty where somebody asked for it."""
        return self._why

    @property
    def stops(self) -> int:
        """How many times it was set."""
        return self._stops

    def set(self, why: str = "") -> bool:
        """Stop; the first reason is kept. Tells whether it was not set before."""
        with self._lock:
            first, self._set = not self._set, True
            self._stops += 1
            self._why = self._why or why
        return first

    def clear(self, stops: int | None = None) -> None:
        """Accept commands again, unless it was set again since it had been set ``stops`` times."""
        with self._lock:
            if stops is None or stops == self._stops:
                self._set, self._why = False, ""

    def check(self, part_name: str, command: str) -> None:
        """Raise CommandRefusedError while the robot is stopped."""
        if self._set:
            reason = f" because {self._why}" if self._why else ""
            raise CommandRefusedError(
                f"{part_name} refused {command}: the robot is stopped{reason}; clear_stop() makes it accept commands"
            )
