"""``run --confirm``: each motion is displayed, and starts after a person has confirmed it."""

from __future__ import annotations

import threading
from collections.abc import Callable

from bestman_bt.control.motion import PlannedMotion
from bestman_bt.runtime.executor import Executor, PauseReason


class Confirmation:
    """Pauses the execution before each motion: resuming starts the motion, ``decline`` refuses it.

    ``asked``: called with each motion, in the executor's thread, before it waits. ``executor``: the executor of the
    motions; without one they start immediately.
    """

    def __init__(self) -> None:
        self.executor: Executor | None = None
        self.asked: list[Callable[[PlannedMotion], None]] = []
        self._lock = threading.Lock()
        self._pending: PlannedMotion | None = None
        self._declined = False

    @property
    def pending(self) -> PlannedMotion | None:
        """The motion that waits for an answer, or None."""
        return self._pending

    def confirm(self, planned: PlannedMotion) -> bool:
        """Display a motion, wait for the answer, and return whether it may start.

        Raises EngineError if the execution ends meanwhile.
        """
        if self.executor is None:
            return True
        with self._lock:
            self._pending, self._declined = planned, False
        try:
            for show in self.asked:
                show(planned)
            swept = [[(round(x, 3), round(y, 3)) for x, y in outline.tolist()] for outline in planned.swept]
            self.executor.hold(PauseReason("confirm", words=str(planned), swept=swept))
            return not self._declined
        finally:
            with self._lock:
                self._pending = None

    def start(self) -> bool:
        """Start the waiting motion; return False if there is none."""
        return self._answer(declined=False)

    def decline(self) -> bool:
        """Refuse the waiting motion; return False if there is none."""
        return self._answer(declined=True)

    def _answer(self, declined: bool) -> bool:
        with self._lock:
            if self._pending is None or self.executor is None:
                return False
            self._declined = declined
            self.executor.resume()
            return True
