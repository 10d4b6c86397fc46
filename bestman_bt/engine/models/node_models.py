"""Descriptions of node types without code here: from the TreeNodesModel of a file, else guessed from their use.

A guess has the ports that are used, ``inout`` if only ``{entries}`` are mapped to them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, ClassVar, Final

from bestman_bt.engine.controls import Sequence
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.ports import Port, key_of
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry, make_info
from bestman_bt.engine.decorators import Decorator
from bestman_bt.engine.leaves.base import Leaf
from bestman_bt.engine.status import RUNNING
from bestman_bt.engine.xml.documents import Documents
from bestman_bt.engine.xml.elements import Element

GUESS: Final = "a guess from its use"
"""Source of the description of a node without a model."""
_DIRECTIONS: Final = {"input_port": "input", "output_port": "output", "inout_port": "inout"}
LIKE_CONDITIONS: Final = ("Is", "Has", "Are", "Can", "Check")

Models = Mapping[str, NodeInfo]
"""Name → description in a TreeNodesModel."""


def with_foreign(registry: NodeRegistry, documents: Documents, models: Models) -> NodeRegistry:
    """Return a registry with all nodes of the documents; unknown ones are placeholders."""
    own = {info.name: info for element, file in documents.node_models if (info := model_info(element, file))}
    known = {**models, **own}
    unknown = [known.get(name) or guessed_info(name, used) for name, used in _uses([documents], registry).items()]
    declared = [info for name, info in own.items() if name not in registry]
    return registry.extended([*declared, *unknown]) if unknown or declared else registry


def unknown_types(files: Iterable[Documents], registry: NodeRegistry, models: Models) -> dict[str, NodeInfo]:
    """Return the node types that trees of files use and a registry lacks, by name."""
    files = list(files)
    trees = {tree_id for documents in files for tree_id in documents.trees}
    uses = {name: used for name, used in _uses(files, registry).items() if name not in trees}
    return {name: models.get(name) or guessed_info(name, used) for name, used in uses.items()}


def _uses(files: Iterable[Documents], registry: NodeRegistry) -> dict[str, list[Element]]:
    """Return the elements of types that a registry does not have, by type."""
    trees = {id(e): e for one in files for e in [tree.element for tree in (*one.trees.values(), *one.replaced)]}
    uses: dict[str, list[Element]] = {}
    for element in (element for tree in trees.values() for child in tree.children for element in child.iter()):
        name = node_name(element)
        if name and name not in registry and element.tag != "SubTree":
            uses.setdefault(name, []).append(element)
    return uses


def node_name(element: Element) -> str:
    """Return the node type of an element of a tree."""
    return element.attributes.get("ID", "") if element.tag in KINDS else element.tag


def model_info(element: Element, file: str) -> NodeInfo | None:
    """Return the description of a node in a TreeNodesModel, or None if it is not usable."""
    name = element.attributes.get("ID", "")
    if not name or element.tag not in KINDS:
        return None
    ports = [
        untyped_port(
            port.attributes["name"], _DIRECTIONS[port.tag], port.attributes.get("default"), port.text.strip(),
            port.attributes.get("type", ""),
        )
        for port in element.children
        if port.tag in _DIRECTIONS and port.attributes.get("name")
    ]  # fmt: skip
    texts = [child.text.strip() for child in element.children if child.tag in ("description", "MetadataFields")]
    description = next(filter(None, texts), "")
    return placeholder(name, element.tag, ports, f"{file}:{element.line}", description)


def guessed_info(name: str, uses: list[Element]) -> NodeInfo:
    """Return a description guessed from the elements that use a node."""
    kinds = [element.tag for element in uses if element.tag in KINDS]
    most = max(len(element.children) for element in uses)
    if kinds:
        kind = kinds[0]
    elif most:
        kind = "Decorator" if most == 1 else "Control"
    else:
        kind = "Condition" if name.startswith(LIKE_CONDITIONS) else "Action"
    return placeholder(name, kind, seen_ports(uses), GUESS)


def seen_ports(uses: Iterable[Element]) -> list[Port]:
    """Return the ports that elements set, with the direction that the values suggest."""
    directions: dict[str, str] = {}
    for element in uses:
        for key, text in element.attributes.items():
            if key not in ("name", "ID") and key[:1] != "_" and ":" not in key and "." not in key:
                literal = key_of(text, key) is None
                directions[key] = "input" if literal else directions.get(key, "inout")
    return [untyped_port(name, direction) for name, direction in directions.items()]


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
    """Return the description of a node type without code; ``known_from``: the source of the description, as text."""
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
