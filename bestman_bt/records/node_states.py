"""The states of all nodes at one moment, with what was counted so far."""

from __future__ import annotations

from array import array
from collections.abc import Iterable

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS

NO = 5
"""Beside the engine's states: FAILURE of a condition, which has answered no, unless its tree ended by it."""


class NodeStates:
    """Indexed by uid; element 0 is unused.

    ``results``: what a node returned since it last started, IDLE for nothing yet: a parent resets a child right after
    the child has returned, and a quick condition would never be seen otherwise. ``starts``: how often it began;
    ``seconds``: how long it ran, up to ``since`` where it runs now.
    """

    def __init__(self) -> None:
        self.states = array("B", b"\0")
        self.results = array("B", b"\0")
        self.starts = array("I", [0])
        self.successes = array("I", [0])
        self.failures = array("I", [0])
        self.seconds = array("d", [0.0])
        self.since = array("d", [0.0])

    def __len__(self) -> int:
        return len(self.states) - 1

    def grow(self, count: int) -> None:
        """Have room for ``count`` nodes; new ones are IDLE."""
        more = count - len(self)
        if more > 0:
            for values in (self.states, self.results, self.starts, self.successes, self.failures):
                values.extend([0] * more)
            self.seconds.extend([0.0] * more)
            self.since.extend([0.0] * more)

    def copy(self) -> NodeStates:
        """An independent copy."""
        other = NodeStates.__new__(NodeStates)
        for name, values in vars(self).items():
            setattr(other, name, values[:])
        return other

    def change(self, uid: int, state: int, time: float) -> bool:
        """A node has taken a state; False where it had it before, as in what a new subscriber is told first."""
        before = self.states[uid]
        if before == state:
            return False
        self.states[uid] = state
        if before == RUNNING:
            self.seconds[uid] += max(0.0, time - self.since[uid])
        elif state != IDLE:
            self.starts[uid] += 1
            self.results[uid] = IDLE
        if state == RUNNING:
            self.since[uid] = time
        elif state == SUCCESS:
            self.successes[uid] += 1
            self.results[uid] = SUCCESS
        elif state in (FAILURE, NO):
            self.failures[uid] += 1
            self.results[uid] = state
        elif state == SKIPPED:
            self.results[uid] = SKIPPED
        return True

    def running(self) -> list[int]:
        """The uids that run, in the order of the tree."""
        return [uid for uid, state in enumerate(self.states) if state == RUNNING]

    def statistics(self, uids: Iterable[int], time: float) -> dict[str, list[float]]:
        """uid → starts, successes, failures and seconds of running up to ``time``; only nodes that ever started."""
        told = {}
        for uid in uids:
            if self.starts[uid]:
                seconds = self.seconds[uid]
                if self.states[uid] == RUNNING:
                    seconds += max(0.0, time - self.since[uid])
                told[str(uid)] = [self.starts[uid], self.successes[uid], self.failures[uid], round(seconds, 3)]
        return told
