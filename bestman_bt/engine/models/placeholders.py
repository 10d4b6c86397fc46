"""Nodes without code: placeholders for types that are known from a file, or only from their use."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, ClassVar, Final

from bestman_bt.engine.controls import Sequence
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import Port
from bestman_bt.engine.core.registry import NodeInfo, make_info
from bestman_bt.engine.decorators import Decorator
from bestman_bt.engine.leaves.base import Leaf
from bestman_bt.engine.status import RUNNING


def _refused(node: Node) -> int:
    raise node.error(f"it is a placeholder: there is no code for '{node.type_id}' here")


class PlaceholderAction(Leaf):
    """Placeholder of an action."""

    def on_tick(self) -> int:
        """Raise NodeError: a placeholder cannot be ticked."""
        return _refused(self)


class PlaceholderCondition(PlaceholderAction):
    """Placeholder of a condition."""

    KIND: ClassVar[str] = "Condition"


class PlaceholderControl(Sequence):
    """Placeholder of a node with several children; in simulation it ticks them as a Sequence."""

    MIN_CHILDREN: ClassVar[int] = 0


class PlaceholderDecorator(Decorator):
    """Placeholder of a node with one child; in simulation it returns the child's result."""

    def on_tick(self) -> int:
        """Tick the child."""
        self.set_state(RUNNING)
        return self.child.execute_tick()


_CLASSES: Final[dict[str, type[Node]]] = {
    "Action": PlaceholderAction,
    "Condition": PlaceholderCondition,
    "Control": PlaceholderControl,
    "Decorator": PlaceholderDecorator,
    "SubTree": PlaceholderAction,
}
KINDS: Final = frozenset(_CLASSES) - {"SubTree"}


def placeholder(name: str, kind: str, ports: Iterable[Port], known_from: str, description: str = "") -> NodeInfo:
    """Return the description of a node type without code; ``known_from``: the source of the description, in words."""
    return replace(
        make_info(name, _CLASSES[kind], builtin=False),
        ports={port.name: port for port in ports},
        description=description,
        known_from=known_from,
    )


def untyped_port(name: str, direction: str, default: Any = None, description: str = "", written_type: str = "") -> Port:
    """Return a port that accepts every text; ``written_type``: its type as a file names it."""
    return Port(name, direction, Any, False, default, description, written_type=written_type)


def is_placeholder(node: Node) -> bool:
    """Return whether a node of a loaded tree has no code here."""
    return node.info is not None and bool(node.info.known_from)


__all__ = ["KINDS", "is_placeholder", "placeholder", "untyped_port"]
