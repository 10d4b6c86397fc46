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

    def __bool__(self) -> bool:
        """Whether the robot is stopped."""
        return self._set

    @property
    def why(self) -> str:
        """The fault that stopped the robot; empty where somebody asked for it."""
        return self._why

    def set(self, why: str = "") -> bool:
        """Stop; the first reason is kept. Tells whether it was not set before."""
        with self._lock:
            first, self._set = not self._set, True
            self._why = self._why or why
        return first

    def clear(self) -> None:
        """Accept commands again."""
        with self._lock:
            self._set, self._why = False, ""

    def check(self, part_name: str, command: str) -> None:
        """Raise CommandRefusedError while the robot is stopped."""
        if self._set:
            reason = f" because {self._why}" if self._why else ""
            raise CommandRefusedError(
                f"{part_name} refused {command}: the robot is stopped{reason}; clear_stop() makes it accept commands"
            )
