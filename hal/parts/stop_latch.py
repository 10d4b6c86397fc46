"""The stop latch shared by all parts of a robot."""

from __future__ import annotations

import threading

from hal.api import Failure, RobotStoppedError


class StopLatch:
    """Set by ``Robot.stop()`` and by faults; while it is set, all parts refuse commands. Thread-safe.

    ``fault``: the cause of the stop, or None for a requested stop. ``stops``: number of times it was set.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._set = False
        self.fault: Failure | None = None
        self.stops = 0

    def __bool__(self) -> bool:
        """Return whether the robot is stopped."""
        return self._set

    def set(self, fault: Failure | None = None) -> bool:
        """Set the latch, keeping the first fault; return whether it was clear before."""
        with self._lock:
            first, self._set = not self._set, True
            self.stops += 1
            self.fault = self.fault or fault
        return first

    def clear(self, stops: int | None = None) -> None:
        """Accept commands again, unless the latch was set again after it had been set ``stops`` times."""
        with self._lock:
            if stops is None or stops == self.stops:
                self._set, self.fault = False, None

    def check(self, part_name: str, command: str) -> None:
        """Raise RobotStoppedError while the robot is stopped."""
        if self._set:
            fault = self.fault
            reason = f" because {fault}" if fault is not None else ""
            text = f"{part_name} refused {command}: the robot is stopped{reason}; clear_stop() makes it accept commands"
            raise RobotStoppedError(text, part_name, fault.vendor_code if fault is not None else "")
