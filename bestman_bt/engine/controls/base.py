"""The base of nodes with several children."""

from __future__ import annotations

from typing import Any, ClassVar

import py_trees
from py_trees.composites import Composite

from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tick_hooks import Tick


class Control(Node, Composite):
    """A node with one or more children: implement ``on_tick()`` with ``execute_tick`` and ``halt_child``."""

    KIND: ClassVar[str] = "Control"
    MIN_CHILDREN: ClassVar[int] = 1
    MAX_CHILDREN: ClassVar[int | None] = None

    def bind_children(self, log: list[Any] | None) -> None:
        """Pair each child with its tick function. Modifies the list in place, so that the current tick sees the
        change.
        """
        pairs: list[tuple[Tick, Node]] = [(child.run, child) for child in self.nodes_below()]
        if hasattr(self, "pairs"):
            self.pairs[:] = pairs
        else:
            self.pairs = pairs

    def refuse(self, instead: Tick) -> None:
        """Replace the tick of this node and of its children, in place."""
        super().refuse(instead)
        self.pairs[:] = [(instead, child) for _, child in self.pairs]


NATIVE_POLICY = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
"""The policy that py_trees' displays read from a parallel node; the decision itself depends on the ports."""
