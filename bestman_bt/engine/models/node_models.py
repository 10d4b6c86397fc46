"""Descriptions of node types without code here: from the TreeNodesModel of a file, else guessed from their use.

A guess has the ports that are used, ``inout`` if only ``{entries}`` are mapped to them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from bestman_bt.engine.core.ports import Port, key_of
from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
from bestman_bt.engine.models.placeholders import KINDS, placeholder, untyped_port
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
    told = [element.tag for element in uses if element.tag in KINDS]
    most = max(len(element.children) for element in uses)
    if most:
        kind = told[0] if told and told[0] in ("Control", "Decorator") else "Decorator" if most == 1 else "Control"
    elif told:
        kind = told[0]
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
