"""Sleep: RUNNING for a while."""

from __future__ import annotations

from bestman_bt.engine.bounds import BoundedPort
from bestman_bt.engine.leaves.base import StatefulAction
from bestman_bt.engine.status import RUNNING, SUCCESS


class Sleep(StatefulAction):
    """RUNNING for ``msec`` milliseconds of the tree's clock, then SUCCESS."""

    CHECKED_AT_TICK = True
    INPUT_PORTS = {"msec": BoundedPort(int, True, "how long, in milliseconds")}

    def on_start(self) -> int:
        """Remember the time."""
        self.end = self.clock.now() + self.get_input("msec") * 1e-3
        return RUNNING if self.get_input("msec") > 0 else SUCCESS

    def on_running(self) -> int:
        """Look at the clock."""
        return SUCCESS if self.clock.now() >= self.end else RUNNING

    def on_halted(self) -> None:
        """Nothing is left moving by a sleep."""
