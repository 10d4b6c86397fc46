"""The base of nodes with one child."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import py_trees

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tick_hooks import Tick
from bestman_bt.engine.status import SKIPPED


class Decorator(Node, py_trees.decorators.Decorator):
    """A node with one child: implement ``on_tick()`` with ``self.child.execute_tick()`` and ``reset_child()``."""

    KIND: ClassVar[str] = "Decorator"
    RESETS_CHILD: ClassVar[bool] = False
    """True if the tick never leaves a finished child behind, so that no search for one is needed."""

    @property
    def child(self) -> Node:
        """The child."""
        return self.children[0]  # type: ignore[return-value]  # as in nodes_below

    if not TYPE_CHECKING:

        @property
        def decorated(self):
            """The child, by py_trees' name."""
            return self.children[0]

    def reset_child(self) -> None:
        """Halt the child if it runs, and make it idle."""
        self.halt_child(self.child)

    def bind_children(self, log: list[Any] | None) -> None:
        """Pair the child with its tick function."""
        child = self.child
        self.only = (child.run, child)

    def refuse(self, instead: Tick) -> None:
        """Replace the tick of this node and of its child."""
        super().refuse(instead)
        self.only = (instead, self.child)

    def bound(self, core: Tick) -> Tick:
        """Return the tick that resets a finished child after the node has its own status, the order of BehaviorTree.CPP
        4."""
        if self.RESETS_CHILD:
            return core

        def run() -> int:
            status = core()
            child = self.child
            if child._s > 1:
                if status != SKIPPED:
                    self.set_state(status)
                child.reset_status()
            return status

        return run
