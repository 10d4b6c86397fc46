"""The nodes of a tree that is known only from the head of its log: numbers, names, types, paths and relations."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine.errors import TreeLoadError
from bestman_bt.engine.logs.btlog import LogError
from bestman_bt.engine.xml.elements import Element, parse_xml

MODELS = "TreeNodesModel"


@dataclass(frozen=True)
class LoggedNode:
    """A node as a log names it.

    ``path``: as ``Node.path`` of the tree that ran. ``parent``: the uid of the node above, None for the root.
    ``category``: ``action``, ``condition``, ``control``, ``decorator`` or ``subtree``; empty where the log's palette
    does not tell. ``ports``: what its ports were given, as text.
    """

    uid: int
    parent: int | None
    name: str
    type: str
    category: str
    path: str
    ports: dict[str, str]

    @property
    def is_leaf(self) -> bool:
        """Whether it is an action or a condition."""
        return self.category in ("action", "condition")


def logged_nodes(xml: str, file: str = "the log") -> tuple[LoggedNode, ...]:
    """The nodes that ``full_tree_xml`` has written, parents before their children.

    Raises:
        LogError: it is no such text.
    """
    try:
        root = parse_xml(xml, file)
    except TreeLoadError as error:
        raise LogError(f"{file} holds a tree that cannot be read: {error}") from error
    bodies = {e.attributes.get("_fullpath", ""): e for e in reversed(root.children) if e.tag == "BehaviorTree"}
    if "" not in bodies:
        raise LogError(f"{file} holds no main tree")
    models = [model for element in root.children if element.tag == MODELS for model in element.children]
    categories = {model.attributes.get("ID", ""): model.tag.lower() for model in models}
    nodes: list[LoggedNode] = []
    numbers: set[int] = set()
    pending: list[tuple[Element, int | None, str]] = [(e, None, "") for e in reversed(bodies.pop("").children)]
    while pending:
        element, parent, prefix = pending.pop()
        node = _node(element, parent, prefix, categories, file)
        if node.uid in numbers:
            raise LogError(f"{file} has two nodes with the number {node.uid}")
        numbers.add(node.uid)
        nodes.append(node)
        children, inside = element.children, prefix
        if element.tag == "SubTree":
            inside = element.attributes.get("_fullpath", node.path)
            body = bodies.pop(inside, None)  # taken once: a log that nests a tree in itself has an end
            children = [] if body is None else body.children
        pending += [(child, node.uid, inside) for child in reversed(children)]
    return tuple(nodes)


def _node(element: Element, parent: int | None, prefix: str, categories: dict[str, str], file: str) -> LoggedNode:
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
        path = f"{prefix}/{own}" if prefix else own
    ports = {key: value for key, value in attributes.items() if key not in ("name", "ID", "_uid", "_fullpath")}
    category = "subtree" if is_subtree else categories.get(element.tag, "")
    return LoggedNode(uid, parent, name, kind, category, path, ports)
