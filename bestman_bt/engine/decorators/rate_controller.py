"""RateController of Nav2: the child at most so many times a second."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Gt

from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.status import IDLE, RUNNING, SUCCESS


class RateController(Decorator):
    """Ticks its child when it starts, while it runs, and then once per period of ``hz``; RUNNING in between."""

    INPUT_PORTS = {"hz": BoundedPort(Annotated[float, Gt(0)], False, "Rate", 10.0)}

    def on_load(self) -> None:
        """Begin with no time running."""
        self.started = 0.0
        self.first = True

    def on_tick(self) -> int:
        """Tick the child if it is due."""
        now = self.clock.now()
        if self._s <= IDLE:
            self.started = now
            self.first = True
        self.set_state(RUNNING)
        if self.first or self.child._s == RUNNING or now - self.started >= 1.0 / self.get_input("hz"):
            self.first = False
            status = self.child.execute_tick()
            if status == SUCCESS:
                self.started = now
            return status
        return RUNNING
