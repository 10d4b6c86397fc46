"""The py_trees interface of a node: attributes and methods of its behaviours, as views of the engine's own state."""

from __future__ import annotations

import typing
import uuid
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import py_trees
from py_trees.behaviour import Behaviour
from py_trees.common import BlackBoxLevel
from py_trees.common import Status as PyTreesStatus

from bestman_bt.engine.status import IDLE, RUNNING, TO_PY_TREES, from_py_trees


class Lazy:
    """A non-data descriptor that creates the attribute on first access; ``__getattr__`` would disable CPython's
    attribute caches.
    """

    def __init__(self, make: Callable[[Any], Any]) -> None:
        self._make = make
        self._name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        if instance is None:
            return self
        value = self._make(instance)
        setattr(instance, self._name, value)
        return value


if TYPE_CHECKING:
    from bestman_bt.engine.core.node import Node
    from bestman_bt.engine.core.tree import Tree

    _Base = Behaviour
else:
    _Base = object


class PyTreesAdapter(_Base):
    """Base class of only ``Node``. ``_s``: the engine's status; ``status`` is py_trees' view of it.

    Attributes that cost time or memory are created on first access.
    """

    __slots__ = ("_s",)

    _s: int
    feedback_message: str = ""
    blackbox_level: BlackBoxLevel = BlackBoxLevel.NOT_A_BLACKBOX
    build_own_tree: ClassVar[staticmethod[[Behaviour], Tree]]
    """``build_tree``, which ``authoring`` sets, since it is built on the nodes."""
    if not TYPE_CHECKING:
        current_child = None
        memory = True
        id = Lazy(lambda node: uuid.uuid4())
        blackboards = Lazy(lambda node: [])
        qualified_name = Lazy(lambda node: f"{type(node).__qualname__}/{node.name}")
        iterator = Lazy(lambda node: node.tick())
        logger = Lazy(lambda node: py_trees.logging.Logger(node.name))
        path = Lazy(lambda node: node.full_path())

        @property
        def status(self) -> PyTreesStatus:
            """The state in py_trees' terms; an idle node shows its last result."""
            return TO_PY_TREES[self._s]

        @status.setter
        def status(self, value: PyTreesStatus) -> None:
            self._s = from_py_trees(value)

    else:
        path: str

    def tick(self) -> Iterator[Behaviour]:
        """Tick as a py_trees behaviour: tick completely, then yield the visited nodes."""
        yield from self.standalone_tree().tick_as_behaviour(self._node)

    def standalone_tree(self) -> Tree:
        """Return the node's tree; a node below a native py_trees composite, which has none, gets its own."""
        node = self._node
        if node.tree is None:
            parent = node.parent
            self.build_own_tree(node)
            node.parent = parent
        return node.owner

    def stop(self, new_status: PyTreesStatus = PyTreesStatus.INVALID) -> None:
        """Stop as a py_trees behaviour: halt the node if it is running, then set it to idle."""
        node = self._node
        if node.tree is not None:
            if self._s == RUNNING:
                node.halt_node()
            node.reset_status()
        if new_status is PyTreesStatus.INVALID:
            for below in self.iterate():
                if isinstance(below, PyTreesAdapter):
                    below._s = IDLE
        else:
            self._s = from_py_trees(new_status)

    def update(self) -> PyTreesStatus:
        """Return the current status; the engine does not call it."""
        return self.status

    def tip(self) -> Behaviour | None:
        """Return the deepest node that is running or decided last, as py_trees does."""
        for child in self.children:
            if child.status == PyTreesStatus.RUNNING:
                return typing.cast(Behaviour, child.tip()) if hasattr(child, "tip") else child
        if self.status == PyTreesStatus.INVALID:
            return None
        decided = [c for c in self.children if c.status == self.status]
        if decided and hasattr(decided[-1], "tip"):
            return decided[-1].tip() or self
        return self

    @property
    def _node(self) -> Node:
        return typing.cast("Node", self)
