"""The operator's speed: a scale of the robot's speed, and pausing of motions."""

from __future__ import annotations

import threading
from collections.abc import Callable

SLOWEST = 0.05
"""Minimum speed scale; below it, progress monitors consider a base stuck."""


class OperatorSpeed:
    """The operator's speed setting. ``share``: scale of the speed of the robot's motions; ``hold`` pauses them.

    ``set_speed``: as ``hal.api.Robot.set_speed``. As a watcher of an executor it pauses motions with the execution;
    ``stands_still``: whether time itself stops, as in simulation, so that this is not needed. Thread-safe.
    """

    def __init__(self, set_speed: Callable[[float], None], stands_still: bool = False) -> None:
        self._set_speed, self._lock = set_speed, threading.Lock()
        self._stands_still = stands_still
        self._holds = False
        self.share = 1.0

    def set(self, share: float) -> None:
        """Set the scale, ``SLOWEST`` to 1. Raises ValueError outside this range."""
        if not SLOWEST <= share <= 1.0:
            raise ValueError(
                f"a speed is {SLOWEST:.0%} to 100%, not {share:.4g} of the usual one; pause holds the robot"
            )
        with self._lock:
            self.share = float(share)
            self._send_speed()

    def hold(self) -> None:
        """Pause motions: they brake on their paths."""
        if self._stands_still:
            return
        with self._lock:
            self._holds = True
            self._send_speed()

    def resume(self) -> None:
        """Continue the motions along their paths."""
        with self._lock:
            if self._holds:
                self._holds = False
                self._send_speed()

    def after_tick(self) -> None:
        """Pause or resume motions with the execution."""

    def held(self, hold: object | None) -> None:
        """Pause or resume motions with the execution."""
        if hold is None:
            self.resume()
        else:
            self.hold()

    def _send_speed(self) -> None:
        self._set_speed(0.0 if self._holds else self.share)
