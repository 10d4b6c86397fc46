"""``run --confirm``: each motion is shown, and starts once a person has said so."""

from __future__ import annotations

import threading
from collections.abc import Callable

from bestman_bt.control.planned_motion import PlannedMotion
from bestman_bt.runtime.executor import Executor, PauseReason


class Confirmation:
    """Holds the execution while a person looks: to let it go on starts the motion, ``decline`` refuses it.

    ``asked``: is called with each motion, in the executor's thread, before it waits. ``executor``: whose motions they
    are; without one they start at once.
    """

    def __init__(self) -> None:
        self.executor: Executor | None = None
        self.asked: list[Callable[[PlannedMotion], None]] = []
        self._lock = threading.Lock()
        self._pending: PlannedMotion | None = None
        self._declined = False

    @property
    def pending(self) -> PlannedMotion | None:
        """What waits for an answer now."""
        return self._pending

    def confirm(self, planned: PlannedMotion) -> bool:
        """Show a motion and wait; whether it may start. EngineError where the execution is ended meanwhile."""
        if self.executor is None:
            return True
        with self._lock:
            self._pending, self._declined = planned, False
        try:
            for tell in self.asked:
                tell(planned)
            swept = [[(round(x, 3), round(y, 3)) for x, y in outline.tolist()] for outline in planned.swept]
            self.executor.hold(PauseReason("confirm", words=str(planned), swept=swept))
            return not self._declined
        finally:
            with self._lock:
                self._pending = None

    def start(self) -> bool:
        """Let the motion that waits start; False where none does."""
        return self._answer(declined=False)

    def decline(self) -> bool:
        """Refuse the motion that waits; False where none does."""
        return self._answer(declined=True)

    def _answer(self, declined: bool) -> bool:
        with self._lock:
            if self._pending is None or self.executor is None:
                return False
            self._declined = declined
            self.executor.resume()
            return True
