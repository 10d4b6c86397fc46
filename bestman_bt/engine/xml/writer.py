"""XML of trees and node descriptions: for files, for Groot2's import, and for logs and monitors with node numbers."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.catalogue import EXTENSIONS
from bestman_bt.engine.conversion import UNTYPED, text_of, type_name
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.leaves.native import PyTreesBehaviour
from bestman_bt.engine.status import NodeStatus

if TYPE_CHECKING:
    from bestman_bt.engine.core.node import Node
    from bestman_bt.engine.core.ports import Port
    from bestman_bt.engine.core.registry import NodeInfo, NodeRegistry
    from bestman_bt.engine.core.tree import Tree

_CPP_TYPES = {
    int: "int",
    float: "double",
    str: "std::string",
    bool: "bool",
    NodeStatus: "BT::NodeStatus",
    list[int]: "std::vector<int>",
    list[float]: "std::vector<double>",
    list[str]: "std::vector<std::string>",
    list[bool]: "std::vector<bool>",
}
_ESCAPES = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
_ESCAPED = re.compile(r"[&<>\"\n\r\t]")
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


class XmlError(EngineError):
    """An object cannot be written as XML."""


def escape(text: str) -> str:
    """Return ``text`` escaped for use between double quotes in XML.

    Raises:
        XmlError: it contains a character that XML cannot represent.
    """
    found = _NOT_XML.search(text)
    if found is not None:
        raise XmlError(f"the character U+{ord(found.group()):04X} in {text[:60]!r} cannot be written as XML")
    return _ESCAPED.sub(lambda match: _ESCAPES[match.group()], text)


class _Lines:
    """Collects indented XML lines."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def element(self, depth: int, tag: str, attributes: Iterable[tuple[str, str]], *, closed: bool) -> None:
        text = "".join(f' {name}="{escape(value)}"' for name, value in attributes)
        self.lines.append(f"{'    ' * depth}<{tag}{text}{'/>' if closed else '>'}")

    def close(self, depth: int, tag: str) -> None:
        self.lines.append(f"{'    ' * depth}</{tag}>")

    def text(self) -> str:
        return "\n".join(self.lines) + "\n"


def tree_to_xml(tree: Tree) -> str:
    """Return a tree as a file that loads to an equal tree; each SubTree's definition is written once.

    Raises:
        XmlError: a value has no text form, or the tree has a native py_trees behaviour.
    """
    return _Exporter(tree).export()


class _Exporter:
    def __init__(self, tree: Tree) -> None:
        self.tree = tree
        self.bodies: dict[str, list[str]] = {}
        self.by_body: dict[tuple[str, str], str] = {}
        main = _identifier(tree.tree_id)
        self.reserved = {main, *(info.name for info in tree.registry)}
        self.main = main if main not in {info.name for info in tree.registry} else f"{main}_tree"

    def export(self) -> str:
        body = self._body(self.tree.root)
        lines = _Lines()
        lines.element(0, "root", [("BTCPP_format", "4"), ("main_tree_to_execute", self.main)], closed=False)
        for tree_id, content in [(self.main, body), *self.bodies.items()]:
            lines.element(1, "BehaviorTree", [("ID", tree_id)], closed=False)
            lines.lines.extend(content)
            lines.close(1, "BehaviorTree")
        lines.close(0, "root")
        return lines.text()

    def _body(self, node: Node) -> list[str]:
        lines = _Lines()
        self._write(node, lines, 2)
        return lines.lines

    def _write(self, node: Node, lines: _Lines, depth: int) -> None:
        if isinstance(node, PyTreesBehaviour):
            raise XmlError(f"the native py_trees behaviour '{node.path}' cannot be written as XML")
        attributes = [(key, _text(node, key, value)) for key, value in node.attributes.items()]
        attributes = [(key, text) for key, text in attributes if key not in ("name", "ID")]
        if isinstance(node, SubTree):
            head = [("ID", self._subtree(node))]
            if node.subtree_path.endswith(f"/{node.name}") or node.subtree_path == node.name:
                head.append(("name", node.name))
            lines.element(depth, "SubTree", [*head, *attributes], closed=True)
            return
        info = self.tree.info_of(node)
        head = [] if node.name == info.name else [("name", node.name)]
        children = node.nodes_below()
        lines.element(depth, info.name, [*head, *attributes], closed=not children)
        for child in children:
            self._write(child, lines, depth + 1)
        if children:
            lines.close(depth, info.name)

    def _subtree(self, node: SubTree) -> str:
        body = self._body(node.nodes_below()[0])
        wanted = _identifier(node.tree_id)
        key = (wanted, "\n".join(body))
        if key not in self.by_body:
            name, number = wanted, 2
            while name in self.reserved:
                name, number = f"{wanted}_{number}", number + 1
            self.reserved.add(name)
            self.by_body[key] = name
            self.bodies[name] = body
        return self.by_body[key]


def _identifier(name: str) -> str:
    return re.sub(r"[^\w.\- ]", "_", name) or "tree"


def _text(node: Node, key: str, value: Any) -> str:
    try:
        return text_of(value)
    except EngineError as error:
        raise XmlError(f"node '{node.path}', port '{key}': {error}") from error


def full_tree_xml(tree: Tree, *, builtin_models: bool = True) -> str:
    """Return a tree with node numbers (``_uid``) and paths, one BehaviorTree per SubTree instance, and the palette.

    This is the format of Groot2's FULLTREE message and of the head of a ``.btlog`` file.
    """
    lines = _Lines()
    lines.element(0, "root", [("BTCPP_format", "4")], closed=False)
    for path, board_root in _instances(tree):
        tree_id = tree.subtree_ids[path]
        lines.element(1, "BehaviorTree", [("ID", tree_id), ("_fullpath", path)], closed=False)
        _write_numbered(tree, board_root, lines, 2)
        lines.close(1, "BehaviorTree")
    infos = [info for info in tree.registry.manifest() if builtin_models or not info.builtin]
    native = {node.type_id: node.KIND for node in tree.nodes if isinstance(node, PyTreesBehaviour)}
    _write_models(infos, lines, {name: kind for name, kind in native.items() if name not in tree.registry})
    lines.close(0, "root")
    return lines.text()


def _instances(tree: Tree) -> list[tuple[str, Node]]:
    found: list[tuple[str, Node]] = [("", tree.root)]
    found.extend((node.subtree_path, node.nodes_below()[0]) for node in tree.nodes if isinstance(node, SubTree))
    return found


def _write_numbered(tree: Tree, node: Node, lines: _Lines, depth: int) -> None:
    info = tree.info_of(node)
    attributes: list[tuple[str, str]]
    if isinstance(node, SubTree):
        attributes = [("ID", node.tree_id), ("_fullpath", node.subtree_path)]
    else:
        attributes = [("name", node.name)]
    attributes.append(("_uid", str(node.uid)))
    for key, value in node.attributes.items():
        if key not in ("name", "ID"):
            try:
                attributes.append((key, text_of(value)))
            except EngineError:
                attributes.append((key, f"<{type(value).__name__}>"))
    children = [] if isinstance(node, SubTree) else node.nodes_below()
    tag = node.type_id if isinstance(node, PyTreesBehaviour) else info.name
    lines.element(depth, tag, attributes, closed=not children)
    for child in children:
        _write_numbered(tree, child, lines, depth + 1)
    if children:
        lines.close(depth, tag)


def palette_xml(registry: NodeRegistry) -> str:
    """Return the TreeNodesModel that Groot2 imports: the registered nodes that BehaviorTree.CPP itself lacks."""
    lines = _Lines()
    lines.element(0, "root", [("BTCPP_format", "4")], closed=False)
    _write_models([info for info in registry.manifest() if not info.builtin or info.name in EXTENSIONS], lines, {})
    lines.close(0, "root")
    return lines.text()


def _write_models(infos: Sequence[NodeInfo], lines: _Lines, native: Mapping[str, str]) -> None:
    """Write the TreeNodesModel. ``native``: class to kind, of native py_trees behaviours."""
    lines.element(1, "TreeNodesModel", (), closed=not infos and not native)
    for info in infos:
        _write_model(info, lines, 2)
    for name, kind in native.items():
        lines.element(2, kind, [("ID", name)], closed=True)
    if infos or native:
        lines.close(1, "TreeNodesModel")


def _write_model(info: NodeInfo, lines: _Lines, depth: int) -> None:
    described = bool(info.description) and (not info.builtin or info.name in EXTENSIONS)
    lines.element(depth, info.kind, [("ID", info.name)], closed=not info.ports and not described)
    for port in info.ports.values():
        attributes = [("name", port.name), ("type", groot_type(port))]
        if port.default is not None:
            attributes.append(("default", text_of(port.default)))
        tag = f"{port.direction}_port"
        accepts = f"{port.description} ({port.accepts})" if port.accepts != port.type_name else port.description
        if accepts:
            text = "".join(f' {name}="{escape(value)}"' for name, value in attributes)
            lines.lines.append(f"{'    ' * (depth + 1)}<{tag}{text}>{escape(accepts)}</{tag}>")
        else:
            lines.element(depth + 1, tag, attributes, closed=True)
    if described:
        lines.lines.append(f"{'    ' * (depth + 1)}<description>{escape(info.description)}</description>")
    if info.ports or described:
        lines.close(depth, info.kind)


def groot_type(port: Port) -> str:
    """Return the C++ type name that Groot2 shows for a port."""
    if port.data_type in UNTYPED:
        return port.written_type or "BT::AnyTypeAllowed"
    return _CPP_TYPES.get(port.data_type, type_name(port.data_type))
