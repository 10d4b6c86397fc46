"""Trees of the engine as the events tell them."""

from __future__ import annotations

from bestman_bt.engine import EngineError, Node, Tree
from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.xml.writer import XmlError, full_tree_xml
from bestman_bt.records.events import MAIN_TREE, Category, DescribedNode, TreeEvent

LONGEST_PORT = 500
"""Characters of a port's text."""
_CATEGORIES: dict[str, Category] = {
    "Action": "action",
    "Condition": "condition",
    "Control": "control",
    "Decorator": "decorator",
    "SubTree": "subtree",
}


def describe_tree(tree: Tree, number: int = MAIN_TREE, under: int | None = None) -> TreeEvent:
    """The event that tells a loaded tree; ``number`` and ``under`` as there."""
    try:
        xml = full_tree_xml(tree, builtin_models=False)
    except XmlError:  # a native behaviour of py_trees, or a value without a text form: shown, but not as XML
        xml = ""
    return TreeEvent([_described(node) for node in tree.nodes], xml, tree.tree_id, number, under)


def category_of(node: Node) -> Category:
    """What kind of node it is."""
    return _CATEGORIES[node.KIND]


def _described(node: Node) -> DescribedNode:
    parent = node.parent.uid if isinstance(node.parent, Node) else None
    ports = {key: _text(value) for key, value in node.attributes.items() if key not in ("name", "ID")}
    scope = "" if node.place is None else node.place.path
    kind, category = _type(node), category_of(node)
    return DescribedNode(node.uid, parent, node.name, kind, category, node.path, ports, scope, node.where)


def _type(node: Node) -> str:
    return node.tree_id if isinstance(node, SubTree) else node.type_id


def _text(value: object) -> str:
    try:
        text = text_of(value)
    except EngineError:
        text = type(value).__name__
    return text if len(text) <= LONGEST_PORT else text[: LONGEST_PORT - 1] + "…"
