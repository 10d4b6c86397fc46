"""SingleTrigger of Nav2: the child once, and then no more."""

from __future__ import annotations

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED


class SingleTrigger(Decorator):
    """Ticks its child until it has ended once, and gives its result; FAILURE after that, until it is started anew."""

    def on_load(self) -> None:
        """Begin with nothing done."""
        self.done = False

    def on_tick(self) -> int:
        """Tick the child if it has not ended yet."""
        if self._s <= IDLE:
            self.done = False
        self.set_state(RUNNING)
        if self.done:
            return FAILURE
        status = self.child.execute_tick()
        self.done = status not in (RUNNING, SKIPPED)
        return status
