"""The base of nodes with several children."""

from __future__ import annotations

from typing import Any, ClassVar

import py_trees
from py_trees.composites import Composite

from bestman_bt.engine.core.around_tick import Tick
from bestman_bt.engine.core.node import Node


class Control(Node, Composite):
    """A node with one or more children: implement ``on_tick()`` with ``execute_tick`` and ``halt_child``."""

    KIND: ClassVar[str] = "Control"
    MIN_CHILDREN: ClassVar[int] = 1
    MAX_CHILDREN: ClassVar[int | None] = None

    def bind_children(self, log: list[Any] | None) -> None:
        """Pair each child with what it is called by; in place: the tick under way goes through the same list."""
        pairs: list[tuple[Tick, Node]] = [(child.run, child) for child in self.nodes_below()]
        if hasattr(self, "pairs"):
            self.pairs[:] = pairs
        else:
            self.pairs = pairs

    def refuse(self, instead: Tick) -> None:
        """In place, too."""
        super().refuse(instead)
        self.pairs[:] = [(instead, child) for _, child in self.pairs]


NATIVE_POLICY = py_trees.common.ParallelPolicy.SuccessOnAll(synchronise=False)
"""What py_trees' displays read from a parallel node; ours decide by their ports."""
