"""Monitors whether the machine keeps up with the twins, to distinguish overload from faults under test."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable

PERIOD = 5.0
"""Seconds of one observation period, and between two messages."""
MOST_GIVEN_UP = 0.1
"""Fraction of real time that the world may lose."""
OLDEST_FRAME, FRAME_PIXELS = 0.3, 640 * 480
"""Longest time from exposure to sending, seconds, at this size; the limit scales with the length of an edge."""


class MachineWatch:
    """Collects delays, and reports them as text once per ``PERIOD`` if they are too large.

    ``report``: receives the text. ``given_up``: total seconds by which the world fell behind real time. Thread-safe.
    """

    def __init__(self, report: Callable[[str], None], clock: Callable[[], float] = time.monotonic) -> None:
        self.report = report
        self.given_up = 0.0
        self._clock, self._lock = clock, threading.Lock()
        self._begun, self._before = clock(), 0.0
        self._frames: dict[str, tuple[float, float]] = {}  # camera → seconds of its oldest frame, and their limit

    def frame(self, camera: str, age: float, pixels: int) -> None:
        """Record that a frame of ``pixels`` is ready to be sent, ``age`` seconds after its exposure."""
        with self._lock:
            oldest = max(age, self._frames.get(camera, (0.0, 0.0))[0])
            self._frames[camera] = oldest, OLDEST_FRAME * math.sqrt(pixels / FRAME_PIXELS)

    def look(self) -> None:
        """Report the delays of the last period if it has ended."""
        passed = self._clock() - self._begun
        if passed < PERIOD:
            return
        with self._lock:
            frames, self._frames = self._frames, {}
        lost, self._before = self.given_up - self._before, self.given_up
        self._begun += passed
        late = [f"the world lost {lost:.1f} s"] if lost > MOST_GIVEN_UP * passed else []
        late += [
            f"frames of {camera} were up to {age:.2f} s old ({limit:.2f} s would do)"
            for camera, (age, limit) in frames.items()
            if age > limit
        ]
        if late:
            self.report(
                f"this machine is too slow for the twins: in the last {passed:.0f} s {', '.join(late)}; what fails "
                "against them meanwhile may fail for that"
            )
