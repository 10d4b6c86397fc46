"""SubTree: another tree as a node, with a blackboard of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from py_trees.behaviour import Behaviour
from py_trees.ports import PortInformation

from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.decorators.mapping import mapping_tick_bare, mapping_tick_traced
from bestman_bt.engine.node import Node
from bestman_bt.engine.status import FAILURE, SUCCESS

if TYPE_CHECKING:
    from bestman_bt.engine.tree import Tree

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
    or ``SubTree(root, target="{cup}")``. A function is called once for each instance. A ``Path`` to an XML file, or a
    tree that was loaded from XML, is read when the tree around it is made; ``loaded`` holds it.
    """

    KIND: ClassVar[str] = "SubTree"
    INPUT_PORTS = {
        "_autoremap": PortInformation(bool, False, "If true, all the ports with the same name will be remapped", False)
    }
    RESETS_CHILD = True
    tree_id: str = ""
    subtree_path: str = ""
    loaded: Tree | Path | None = None
    tick_bare = mapping_tick_bare(SUCCESS, FAILURE, keeps=True)
    tick_traced = _tick_traced

    def __init__(
        self,
        tree: Callable[[], Node] | Behaviour | Tree | Path,
        *args: Any,
        name: str | None = None,
        tree_id: str | None = None,
        **attributes: Any,
    ) -> None:
        children: list[Behaviour] = []
        if isinstance(tree, Behaviour):
            children, found = [tree], tree.name
        elif isinstance(tree, Path):
            self.loaded, found = tree, tree.stem
        elif callable(tree):
            children, found = [tree()], getattr(tree, "__name__", "tree")
        elif hasattr(tree, "tree_id"):
            self.loaded, found = tree, tree.tree_id
        else:
            raise TypeError(
                f"SubTree takes a node, a function that returns one, a loaded tree or a Path but got {tree!r}"
            )
        self.tree_id = tree_id or found
        self.named = name is not None or bool(args)
        super().__init__(*args, children, name=name if name is not None or args else self.tree_id, **attributes)

    @property
    def type_id(self) -> str:
        """The ID of the tree that it runs."""
        return self.tree_id
