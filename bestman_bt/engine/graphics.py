"""Pictures of a tree: SVG drawn without graphviz, and DOT for use with graphviz."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, Final

from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.palette import STATE_COLORS, STATE_MARKS
from bestman_bt.engine.status import IDLE, STATUS_NAMES


def render_text(tree: Tree, states: Mapping[int, int] | None = None, *, ports: bool = True) -> str:
    """Return the tree as indented text, one node per line.

    Args:
        tree: the tree.
        states: uid → status, to mark the nodes with; ``current_states(tree)`` returns the live ones.
        ports: whether to print each node's attributes after its name.
    """
    lines: list[str] = []
    _render(tree, tree.root, "", "", states, ports, lines)
    return "\n".join(lines) + "\n"


def render_paths(tree: Tree) -> str:
    """Return a line for each node with its number and path, the names for breakpoints and requests.

    A path shared by several nodes does not identify any of them; use their numbers.
    """
    count = Counter(node.path for node in tree.nodes)
    shared = "  (by number alone: several have this path)"
    return "".join(f"{node.uid:>5}  {node.path}{shared if count[node.path] > 1 else ''}\n" for node in tree.nodes)


def current_states(tree: Tree, *, last_results: bool = True) -> dict[int, int]:
    """Return the current uid → status of every node; with ``last_results`` an idle node shows its last result."""
    return {node.uid: node.last_result if last_results else node.state for node in tree.nodes}


def node_label(node: Node) -> str:
    """Return a node's name, and its type if the name differs."""
    if isinstance(node, SubTree):
        return f"SubTree {node.tree_id}" + (f" '{node.name}'" if node.name != node.tree_id else "")
    return node.type_id if node.name == node.type_id else f"{node.type_id} '{node.name}'"


def _is_placeholder(node: Node) -> bool:
    return node.info is not None and bool(node.info.known_from)


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
    absent = " [placeholder]" if _is_placeholder(node) else ""
    lines.append(f"{lead}{mark}{node_label(node)}{absent}{attributes}{state}")
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


_NOT_XML: Final = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")
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


@dataclass
class NodeBox:
    """The drawing of one node: text, frame and tooltip, and the boxes to its right."""

    lines: list[str]
    tooltip: str
    fill: str = "#ffffff"
    stroke: str = STATE_COLORS[IDLE]
    stroke_width: float = 1
    dashed: bool = False
    children: list[NodeBox] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0

    @property
    def width(self) -> float:
        """Width of the frame, pixels."""
        return max(len(line) for line in self.lines) * _CHARACTER + 2 * _PADDING

    @property
    def height(self) -> float:
        """Height of the frame, pixels."""
        return len(self.lines) * _LINE + _PADDING


def render_svg(tree: Tree, states: Mapping[int, int] | None = None) -> str:
    """Return the tree as an SVG picture, root at the left; ``states`` (uid to status) colour the frames."""
    return render_boxes([_box(tree.root, states)], tree.tree_id)


def render_boxes(roots: list[NodeBox], title: str) -> str:
    """Return an SVG picture of boxes, one root below the other."""
    widths: list[float] = []
    for root in roots:
        _measure(root, 0, widths)
    columns = [_PADDING + sum(widths[:depth]) + depth * _GAP_X for depth in range(len(widths))]
    bottom: float = _PADDING
    for index, root in enumerate(roots):
        bottom = _place(root, 0, columns, bottom + (_GAP_Y if index else 0))
    width, height = columns[-1] + widths[-1] + _PADDING, bottom + _PADDING
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="ui-monospace, monospace" font-size="11">',
        f"<title>{_in_xml(title)}</title>",
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]
    for root in roots:
        _draw(root, parts)
    parts.append("</svg>")
    return "\n".join(parts) + "\n"


def _in_xml(text: str) -> str:
    return escape(_NOT_XML.sub("\ufffd", text), quote=False)


def _box(node: Node, states: Mapping[int, int] | None) -> NodeBox:
    ports = port_texts(node)
    lines = [node_label(node), *ports[:_MAX_PORTS]]
    if len(ports) > _MAX_PORTS:
        lines.append(f"... {len(ports) - _MAX_PORTS} more")
    status = IDLE if states is None else states.get(node.uid, IDLE)
    return NodeBox(
        lines,
        f"{node.path} {STATUS_NAMES[status]}",
        _FILL.get(node.KIND, "#ffffff"),
        STATE_COLORS[status],
        1 if status == IDLE else 2.5,
        _is_placeholder(node),
        [_box(child, states) for child in node.children if isinstance(child, Node)],
    )


def _measure(box: NodeBox, depth: int, widths: list[float]) -> None:
    if depth == len(widths):
        widths.append(0.0)
    widths[depth] = max(widths[depth], box.width)
    for child in box.children:
        _measure(child, depth + 1, widths)


def _place(box: NodeBox, depth: int, columns: list[float], top: float) -> float:
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


def _draw(box: NodeBox, parts: list[str]) -> None:
    for child in box.children:
        x0, y0 = box.x + box.width, box.y + box.height / 2
        x1, y1 = child.x, child.y + child.height / 2
        middle = (x0 + x1) / 2
        parts.append(
            f'<path d="M{x0:.1f},{y0:.1f} C{middle:.1f},{y0:.1f} {middle:.1f},{y1:.1f} {x1:.1f},{y1:.1f}" '
            f'fill="none" stroke="{STATE_COLORS[IDLE]}"/>'
        )
    dashes = ' stroke-dasharray="5 3"' if box.dashed else ""
    parts.append(f"<g><title>{_in_xml(box.tooltip)}</title>")
    parts.append(
        f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" rx="5" '
        f'fill="{box.fill}" stroke="{box.stroke}" stroke-width="{box.stroke_width}"{dashes}/>'
    )
    for index, line in enumerate(box.lines):
        style = 'font-weight="bold"' if index == 0 else 'fill="#57606a"'
        parts.append(
            f'<text x="{box.x + _PADDING:.1f}" y="{box.y + _LINE * (index + 1):.1f}" {style}>{_in_xml(line)}</text>'
        )
    parts.append("</g>")
    for child in box.children:
        _draw(child, parts)


_SHAPES: Final = {
    "Action": "box",
    "Condition": "ellipse",
    "Control": "box",
    "Decorator": "octagon",
    "SubTree": "folder",
}


def render_dot(tree: Tree, states: Mapping[int, int] | None = None) -> str:
    """Return the tree in the DOT language of graphviz."""
    lines = [f"digraph {quoted(tree.tree_id)} {{", "  rankdir=LR;", '  node [fontname="monospace", style=filled];']
    for node in tree.nodes:
        status = IDLE if states is None else states.get(node.uid, IDLE)
        dashes = ', style="filled,dashed"' if _is_placeholder(node) else ""
        label = "\\n".join(_escaped(line) for line in [node_label(node), *port_texts(node)])
        lines.append(
            f'  n{node.uid} [label="{label}", shape={_SHAPES.get(node.KIND, "box")}, '
            f'fillcolor="{_FILL.get(node.KIND, "#ffffff")}", color="{STATE_COLORS[status]}"{dashes}];'
        )
        lines.extend(f"  n{node.uid} -> n{child.uid};" for child in node.children if isinstance(child, Node))
    return "\n".join([*lines, "}"]) + "\n"


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def quoted(text: str) -> str:
    """Return a quoted string for DOT."""
    return f'"{_escaped(text)}"'
