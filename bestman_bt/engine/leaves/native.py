"""Any native py_trees behaviour, or a whole native subtree, as a leaf of ours."""

from __future__ import annotations

from py_trees.behaviour import Behaviour
from py_trees.common import Status as PyTreesStatus

from bestman_bt.engine.leaves.base import Leaf
from bestman_bt.engine.status import RUNNING, from_py_trees


class PyTreesBehaviour(Leaf):
    """Ticks a native py_trees behaviour; INVALID, which no tick should end with, is an error."""

    def __init__(self, behaviour: Behaviour | None = None, *, name: str | None = None) -> None:
        if behaviour is None:
            raise TypeError("PyTreesBehaviour takes the behaviour that it adapts")
        super().__init__(name=name or behaviour.name)
        self.behaviour = behaviour
        self.children = [behaviour]
        behaviour.parent = self

    def on_tick(self) -> int:
        """Tick the behaviour to its end and return its status."""
        behaviour = self.behaviour
        for _ in behaviour.tick():
            pass
        self.feedback_message = behaviour.feedback_message
        return from_py_trees(behaviour.status)

    def halt(self) -> None:
        """Stop the behaviour if it runs."""
        if self._s == RUNNING or self.behaviour.status == PyTreesStatus.RUNNING:
            self.behaviour.stop(PyTreesStatus.INVALID)
        self.reset_status()
