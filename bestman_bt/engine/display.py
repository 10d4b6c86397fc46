"""A tree as text, with the nodes' states where they are known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from bestman_bt.engine.conversion import text_of
from bestman_bt.engine.decorators.subtree import SubTree
from bestman_bt.engine.errors import EngineError
from bestman_bt.engine.node import Node
from bestman_bt.engine.status import IDLE, STATUS_NAMES
from bestman_bt.engine.tree import Tree

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
