"""A tree as a picture: SVG drawn here, without graphviz, and DOT for those who have it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Final

from bestman_bt.engine.display import node_label, port_texts
from bestman_bt.engine.node import Node
from bestman_bt.engine.status import IDLE, STATUS_NAMES
from bestman_bt.engine.tree import Tree

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
