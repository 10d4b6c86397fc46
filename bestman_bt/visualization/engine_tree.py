"""From the engine's trees and events to what the views of this package show."""

from __future__ import annotations

from bestman_bt.engine import IDLE, Node, StateChanges, Tree
from bestman_bt.visualization.tree_description import DescribedNode, NodeTransition


def describe_tree(tree: Tree) -> list[DescribedNode]:
    """The nodes of a loaded tree, parents before children."""
    nodes: list[DescribedNode] = []
    pending: list[tuple[Node, int | None]] = [(tree.root, None)]
    while pending:
        node, parent = pending.pop()
        nodes.append(DescribedNode(node.uid, node.name, node.type_id, parent, node.KIND == "Condition"))
        pending.extend((child, node.uid) for child in reversed(node.children) if isinstance(child, Node))
    return nodes


def describe_changes(tree: Tree, changes: StateChanges, start: float = 0.0) -> list[NodeTransition]:
    """The state changes of one tick, in seconds since ``start``; what is not idle tells its ``feedback_message``."""
    return [
        NodeTransition(uid, state, changes.stamp - start, "" if state == IDLE else tree.nodes[uid - 1].feedback_message)
        for uid, state in changes
    ]
