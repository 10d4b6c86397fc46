"""Trees in events: of the engine, or from a log that holds them as XML."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

from bestman_bt.engine import EngineError, Node, StateChanges, Tree, TreeLoadError
from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.logs.btlog import LogError
from bestman_bt.engine.models.node_models import is_placeholder
from bestman_bt.engine.status import IDLE
from bestman_bt.engine.xml.elements import Element, parse_xml
from bestman_bt.engine.xml.writer import XmlError, escape, full_tree_xml
from bestman_bt.records.events import MAIN_TREE, Category, DescribedNode, StatesEvent, TreeEvent

LONGEST_PORT = 500
"""Characters of a port's text."""
_CATEGORIES: dict[str, Category] = {name: name for name in get_args(Category)}


def describe_tree(tree: Tree, number: int = MAIN_TREE, under: int | None = None) -> TreeEvent:
    """Return the event that describes a loaded tree; ``number`` and ``under``: fields of the event."""
    try:
        xml = full_tree_xml(tree, builtin_models=False)
    except XmlError:  # a native behaviour of py_trees, or a value without a text form: shown, but not as XML
        xml = ""
    return TreeEvent([_described(node) for node in tree.nodes], xml, tree.tree_id, number, under)


def describe_changes(
    tree: Tree, changes: StateChanges, start: float, tick: int, number: int = MAIN_TREE
) -> StatesEvent:
    """Return the event of one tick's changes, with the feedback of active nodes; ``start``: of the run, seconds."""
    said = {uid: text for uid, state in changes if state != IDLE and (text := tree.nodes[uid - 1].feedback_message)}
    return StatesEvent(changes.stamp - start, tick, list(changes), said, number)


def category_of(node: Node) -> Category:
    """Return the category of a node."""
    return _CATEGORIES[node.KIND.lower()]


def _described(node: Node) -> DescribedNode:
    parent = node.parent.uid if isinstance(node.parent, Node) else None
    ports = {key: _text(value) for key, value in node.attributes.items() if key not in ("name", "ID")}
    scope = "" if node.place is None else node.place.path
    kind = node.tree_id if isinstance(node, SubTree) else node.type_id
    return DescribedNode(
        node.uid, parent, node.name, kind, category_of(node), node.path, ports, scope, node.where, is_placeholder(node)
    )


def _text(value: object) -> str:
    try:
        text = text_of(value)
    except EngineError:
        text = type(value).__name__
    return _shortened(text)


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_PORT else text[: LONGEST_PORT - 1] + "…"


def describe_xml(xml: str, file: str = "the log") -> TreeEvent:
    """Return the main tree of XML from ``full_tree_xml``: parents before children, with the original paths.

    Raises:
        LogError: the text is not valid.
    """
    try:
        root = parse_xml(xml, file)
    except TreeLoadError as error:
        raise LogError(f"{file} holds a tree that cannot be read: {error}") from error
    bodies = {e.attributes.get("_fullpath", ""): e for e in reversed(root.children) if e.tag == "BehaviorTree"}
    if "" not in bodies:
        raise LogError(f"{file} holds no main tree")
    main = bodies.pop("")
    models = [model for element in root.children if element.tag == "TreeNodesModel" for model in element.children]
    palette = {model.attributes.get("ID", ""): model.tag.lower() for model in models}
    nodes: dict[int, DescribedNode] = {}
    pending: list[tuple[Element, int | None, str]] = [(e, None, "") for e in reversed(main.children)]
    while pending:
        element, parent, scope = pending.pop()
        node = _logged(element, parent, scope, palette, file)
        if node.uid in nodes:
            raise LogError(f"{file} has two nodes with the number {node.uid}")
        nodes[node.uid] = node
        children, inside = element.children, scope
        if node.category == "subtree":
            inside = element.attributes.get("_fullpath", node.path)
            body = bodies.pop(inside, None)  # taken once: a log that nests a tree in itself has an end
            children = [] if body is None else body.children
        pending += [(child, node.uid, inside) for child in reversed(children)]
    return TreeEvent(list(nodes.values()), xml, main.attributes.get("ID", ""))


def _logged(element: Element, parent: int | None, scope: str, palette: dict[str, str], file: str) -> DescribedNode:
    attributes = element.attributes
    number = attributes.get("_uid", "")
    if not (number.isascii() and number.isdigit()):
        raise LogError(f"{file}, line {element.line}: <{element.tag}> has the number {number[:20]!r}")
    uid = int(number)
    is_subtree = element.tag == "SubTree"
    kind = attributes.get("ID", element.tag) if is_subtree else element.tag
    path = attributes.get("_fullpath", "") if is_subtree else ""
    name = attributes.get("name") or path.rpartition("/")[2].removesuffix(f"::{uid}") or kind
    if not path:
        own = name if name != kind else f"{name}::{uid}"
        path = f"{scope}/{own}" if scope else own
    ports = {
        key: _shortened(value) for key, value in attributes.items() if key not in ("name", "ID", "_uid", "_fullpath")
    }
    known = _CATEGORIES.get("subtree" if is_subtree else palette.get(element.tag, ""))
    return DescribedNode(
        uid, parent, name, kind, known or ("control" if element.children else "action"), path, ports, scope
    )


def xml_of(nodes: Sequence[DescribedNode], tree_id: str) -> str:
    """Return XML like that of ``full_tree_xml``, without SubTrees; characters that XML lacks become ``?``."""
    lines = [f'<root BTCPP_format="4"><BehaviorTree ID="{_escaped(tree_id)}" _fullpath="">']
    open_nodes: list[DescribedNode] = []
    for node in nodes:
        while open_nodes and open_nodes[-1].uid != node.parent:
            lines.append(f"</{open_nodes.pop().type}>")
        lines.append(f'<{node.type} name="{_escaped(node.name)}" _uid="{node.uid}">')
        open_nodes.append(node)
    lines += [f"</{node.type}>" for node in reversed(open_nodes)]
    lines.append("</BehaviorTree><TreeNodesModel>")
    models = {node.type: node.category.capitalize() for node in nodes}
    lines += [f'<{category} ID="{kind}"/>' for kind, category in models.items()]
    return "\n".join([*lines, "</TreeNodesModel></root>", ""])


def _escaped(text: str) -> str:
    return escape("".join(letter if letter.isprintable() else "?" for letter in text))
