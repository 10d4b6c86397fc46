"""How fast an operator lets the robot move: a share of its speed, and whether it waits on its way."""

from __future__ import annotations

import threading
from collections.abc import Callable

SLOWEST = 0.05
"""The smallest share that may be set: below it what watches for progress takes a base for stuck."""


class OperatorSpeed:
    """``share`` of the robot's speed at which its motions run; ``hold`` lets them wait where they are.

    ``set_speed``: as ``hal.api.Robot.set_speed``. A watcher of an executor: while that waits, the motions do;
    ``stands_still``: time itself does then, in simulation, and nothing else has to. Safe from any thread.
    """

    def __init__(self, set_speed: Callable[[float], None], stands_still: bool = False) -> None:
        self._set_speed, self._lock = set_speed, threading.Lock()
        self._stands_still = stands_still
        self._holds = False
        self.share = 1.0

    def set(self, share: float) -> None:
        """Go on at ``share`` of the speed, ``SLOWEST`` to 1; ValueError."""
        if not SLOWEST <= share <= 1.0:
            raise ValueError(
                f"a speed is {SLOWEST:.0%} to 100%, not {share:.4g} of the usual one; pause holds the robot"
            )
        with self._lock:
            self.share = float(share)
            self._tell()

    def hold(self) -> None:
        """Motions brake on their paths and wait there."""
        if self._stands_still:
            return
        with self._lock:
            self._holds = True
            self._tell()

    def go_on(self) -> None:
        """Motions go on along their paths."""
        with self._lock:
            if self._holds:
                self._holds = False
                self._tell()

    def after_tick(self) -> None:
        """As a watcher of an executor."""

    def held(self, hold: object | None) -> None:
        """As a watcher of an executor."""
        if hold is None:
            self.go_on()
        else:
            self.hold()

    def _tell(self) -> None:
        self._set_speed(0.0 if self._holds else self.share)
