"""A tree as a picture: SVG drawn here, without graphviz, and DOT for those who have it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, Final

from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.status import IDLE, STATUS_NAMES
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import EngineError

# A tree as text, with the nodes' states where they are known.


STATE_MARKS = ("·", "▶", "✓", "✗", "↷")
"""Marks of IDLE, RUNNING, SUCCESS, FAILURE and SKIPPED."""


def render_text(tree: Tree, states: Mapping[int, int] | None = None, *, ports: bool = True) -> str:
    """Return the tree as indented text, one node a line.

    Args:
        tree: the tree.
        states: uid to status, to mark the nodes with; ``current_states(tree)`` gives the live ones.
        ports: whether each node's attributes follow its name.
    """
    lines: list[str] = []
    _render(tree, tree.root, "", "", states, ports, lines)
    return "\n".join(lines) + "\n"


def render_paths(tree: Tree) -> str:
    """Return a line for each node: its number and its path, by either of which breakpoints and requests name it.

    A path that several nodes have names none of them; those are named by number.
    """
    count = Counter(node.path for node in tree.nodes)
    shared = "  (by number alone: several have this path)"
    return "".join(f"{node.uid:>5}  {node.path}{shared if count[node.path] > 1 else ''}\n" for node in tree.nodes)


def current_states(tree: Tree, *, last_results: bool = True) -> dict[int, int]:
    """Return uid to status of every node, now; with ``last_results`` an idle node shows what it returned last."""
    return {node.uid: node.last_result if last_results else node.state for node in tree.nodes}


def node_label(node: Node) -> str:
    """Return a node's name, and its type where the name is another."""
    if isinstance(node, SubTree):
        return f"SubTree {node.tree_id}" + (f" '{node.name}'" if node.name != node.tree_id else "")
    return node.type_id if node.name == node.type_id else f"{node.type_id} '{node.name}'"


def port_texts(node: Node) -> list[str]:
    """Return a node's attributes as ``port=value``."""
    return [f"{key}={_shown(value)}" for key, value in node.attributes.items() if key not in ("name", "ID")]


def _shown(value: Any) -> str:
    try:
        text = text_of(value)
    except EngineError:
        text = type(value).__name__
    return text if len(text) <= 60 else text[:57] + "..."


def _render(
    tree: Tree,
    node: Node,
    lead: str,
    indent: str,
    states: Mapping[int, int] | None,
    ports: bool,
    lines: list[str],
) -> None:
    texts = port_texts(node) if ports else []
    mark = "" if states is None else STATE_MARKS[states.get(node.uid, IDLE)] + " "
    state = "" if states is None else f"  [{STATUS_NAMES[states.get(node.uid, IDLE)]}]"
    attributes = "  " + " ".join(texts) if texts else ""
    lines.append(f"{lead}{mark}{node_label(node)}{attributes}{state}")
    children = [child for child in node.children if isinstance(child, Node)]
    for index, child in enumerate(children):
        last = index == len(children) - 1
        _render(
            tree,
            child,
            indent + ("└── " if last else "├── "),
            indent + ("    " if last else "│   "),
            states,
            ports,
            lines,
        )


_CHARACTER: Final = 6.6
_LINE: Final = 15
_PADDING: Final = 8
_GAP_X: Final = 46
_GAP_Y: Final = 10
_MAX_PORTS: Final = 6
_FILL: Final = {
    "Action": "#e8f1fb",
    "Condition": "#fdf3d8",
    "Control": "#ffffff",
    "Decorator": "#f1ecf9",
    "SubTree": "#e7f5ea",
}
_STATE: Final = ("#8a8f98", "#1f6feb", "#1a7f37", "#cf222e", "#9a6700")


@dataclass
class _Box:
    node: Node
    lines: list[str]
    width: float
    height: float
    x: float = 0.0
    y: float = 0.0
    children: list[_Box] = field(default_factory=list)


def render_svg(tree: Tree, states: Mapping[int, int] | None = None) -> str:
    """Return the tree as an SVG picture, root at the left; ``states`` (uid to status) colour the frames."""
    root = _box(tree.root)
    widths: list[float] = []
    _measure(root, 0, widths)
    columns = [_PADDING + sum(widths[:depth]) + depth * _GAP_X for depth in range(len(widths))]
    bottom = _place(root, 0, columns, _PADDING)
    width, height = columns[-1] + widths[-1] + _PADDING, bottom + _PADDING
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="ui-monospace, monospace" font-size="11">',
        f"<title>{escape(tree.tree_id, quote=False)}</title>",
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]
    _draw(root, states, parts)
    parts.append("</svg>")
    return "\n".join(parts) + "\n"


def _box(node: Node) -> _Box:
    ports = port_texts(node)
    lines = [node_label(node), *ports[:_MAX_PORTS]]
    if len(ports) > _MAX_PORTS:
        lines.append(f"... {len(ports) - _MAX_PORTS} more")
    width = max(len(line) for line in lines) * _CHARACTER + 2 * _PADDING
    box = _Box(node, lines, width, len(lines) * _LINE + _PADDING)
    box.children = [_box(child) for child in node.children if isinstance(child, Node)]
    return box


def _measure(box: _Box, depth: int, widths: list[float]) -> None:
    if depth == len(widths):
        widths.append(0.0)
    widths[depth] = max(widths[depth], box.width)
    for child in box.children:
        _measure(child, depth + 1, widths)


def _place(box: _Box, depth: int, columns: list[float], top: float) -> float:
    """Place a box and those below it from ``top`` on; return where they end."""
    box.x = columns[depth]
    bottom = top
    for child in box.children:
        bottom = _place(child, depth + 1, columns, bottom) + _GAP_Y
    if box.children:
        bottom -= _GAP_Y
        first, last = box.children[0], box.children[-1]
        box.y = max(top, (first.y + last.y + last.height - box.height) / 2)
    else:
        box.y = top
    return max(bottom, box.y + box.height)


def _draw(box: _Box, states: Mapping[int, int] | None, parts: list[str]) -> None:
    status = IDLE if states is None else states.get(box.node.uid, IDLE)
    stroke = _STATE[status]
    fill = _FILL.get(box.node.KIND, "#ffffff")
    for child in box.children:
        x0, y0 = box.x + box.width, box.y + box.height / 2
        x1, y1 = child.x, child.y + child.height / 2
        middle = (x0 + x1) / 2
        parts.append(
            f'<path d="M{x0:.1f},{y0:.1f} C{middle:.1f},{y0:.1f} {middle:.1f},{y1:.1f} {x1:.1f},{y1:.1f}" '
            'fill="none" stroke="#8a8f98"/>'
        )
    parts.append(f"<g><title>{escape(box.node.path, quote=False)} {STATUS_NAMES[status]}</title>")
    parts.append(
        f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" rx="5" '
        f'fill="{fill}" stroke="{stroke}" stroke-width="{1 if status == IDLE else 2.5}"/>'
    )
    for index, line in enumerate(box.lines):
        style = 'font-weight="bold"' if index == 0 else 'fill="#57606a"'
        parts.append(
            f'<text x="{box.x + _PADDING:.1f}" y="{box.y + _LINE * (index + 1):.1f}" {style}>'
            f"{escape(line, quote=False)}</text>"
        )
    parts.append("</g>")
    for child in box.children:
        _draw(child, states, parts)


_SHAPES: Final = {
    "Action": "box",
    "Condition": "ellipse",
    "Control": "box",
    "Decorator": "octagon",
    "SubTree": "folder",
}


def render_dot(tree: Tree, states: Mapping[int, int] | None = None) -> str:
    """Return the tree in graphviz' DOT language."""
    lines = [f"digraph {_quoted(tree.tree_id)} {{", "  rankdir=LR;", '  node [fontname="monospace", style=filled];']
    for node in tree.nodes:
        status = IDLE if states is None else states.get(node.uid, IDLE)
        label = "\\n".join(_escaped(line) for line in [node_label(node), *port_texts(node)])
        lines.append(
            f'  n{node.uid} [label="{label}", shape={_SHAPES.get(node.KIND, "box")}, '
            f'fillcolor="{_FILL.get(node.KIND, "#ffffff")}", color="{_STATE[status]}"];'
        )
        lines.extend(f"  n{node.uid} -> n{child.uid};" for child in node.children if isinstance(child, Node))
    return "\n".join([*lines, "}"]) + "\n"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _quoted(text: str) -> str:
    return f'"{_escaped(text)}"'
