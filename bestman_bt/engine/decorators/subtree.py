"""SubTree: another tree as a node, with a blackboard of its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.ports import PortInformation

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.decorators.mapping import mapping_tick_bare, mapping_tick_traced
from bestman_bt.engine.node import Node
from bestman_bt.engine.status import FAILURE, SUCCESS

_traced = mapping_tick_traced(SUCCESS, FAILURE)


def _tick_traced(self: Any) -> int:
    code = self._s
    if code <= 1:
        return _traced(self)
    self._s = 1  # one that still holds SUCCESS or FAILURE is not set RUNNING again
    try:
        return _traced(self)
    finally:
        self._s = code


class SubTree(Decorator):
    """Runs another tree. Its attributes map the subtree's keys: ``key="{outer}"``, ``key="literal"``.

    In Python: ``SubTree(build_pick, target="{cup}")`` with a function that returns the subtree's root,
    or ``SubTree(root, target="{cup}")``. A function is called once for each instance.
    """

    KIND: ClassVar[str] = "SubTree"
    INPUT_PORTS = {
        "_autoremap": PortInformation(bool, False, "If true, all the ports with the same name will be remapped", False)
    }
    RESETS_CHILD = True
    tree_id: str = ""
    subtree_path: str = ""
    tick_bare = mapping_tick_bare(SUCCESS, FAILURE, keeps=True)
    tick_traced = _tick_traced

    def __init__(
        self,
        tree: Callable[[], Node] | Behaviour,
        *args: Any,
        name: str | None = None,
        tree_id: str | None = None,
        **attributes: Any,
    ) -> None:
        if isinstance(tree, Behaviour):
            child, found = tree, tree.name
        elif callable(tree):
            child, found = tree(), getattr(tree, "__name__", "tree")
        else:
            raise TypeError(f"SubTree takes a node or a function that returns one but got {tree!r}")
        self.tree_id = tree_id or found
        self.named = name is not None or bool(args)
        super().__init__(*args, child, name=name if name is not None or args else self.tree_id, **attributes)

    @property
    def type_id(self) -> str:
        """The ID of the tree that it runs."""
        return self.tree_id
