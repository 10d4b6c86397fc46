"""Which nodes of a large tree to show when the terminal has too few lines."""

from __future__ import annotations

from bestman_bt.engine.status import IDLE, RUNNING, SUCCESS
from bestman_bt.records.events import DescribedNode
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import LOOKS, WAS, look_of
from bestman_bt.records.states import NO, NodeStates


def folded_nodes(tree: NodeList, states: NodeStates, lines: int) -> set[int]:
    """The uids of nodes whose children to hide so that at most ``lines`` nodes remain, as far as that is possible.

    What runs stays visible with everything above it. Nodes that were never ticked fold first, then what
    succeeded, then what failed; among equals the deepest first, so that no more is hidden than needed.
    """
    sizes = _subtree_sizes(tree)
    active = _with_running_below(tree, states)
    foldable = [node for node in tree.depth_first() if sizes[node.uid] > 1 and node.uid not in active]
    foldable.sort(key=lambda node: (_rank(states, node), -tree.depth(node.uid)))
    folded: set[int] = set()
    visible = len(tree)
    hidden_below: dict[int, int] = {}
    for node in foldable:
        if visible <= lines:
            break
        already = _hidden_in(tree, node, folded, hidden_below)
        hidden_below[node.uid] = sizes[node.uid] - 1
        visible -= sizes[node.uid] - 1 - already
        folded.add(node.uid)
    return folded


def hidden_count(tree: NodeList, uid: int) -> int:
    """How many nodes lie below a node."""
    return _subtree_sizes(tree)[uid] - 1


def _rank(states: NodeStates, node: DescribedNode) -> int:
    look = look_of(states, node.uid)
    if look is LOOKS[IDLE]:
        return 0
    return 1 if look in (WAS[SUCCESS], WAS[NO], LOOKS[SUCCESS], LOOKS[NO]) else 2


def _subtree_sizes(tree: NodeList) -> dict[int, int]:
    sizes: dict[int, int] = {}
    for node in reversed(list(tree.depth_first())):
        sizes[node.uid] = 1 + sum(sizes[child.uid] for child in tree.children(node.uid))
    return sizes


def _with_running_below(tree: NodeList, states: NodeStates) -> set[int]:
    """Nodes with a running node strictly below them."""
    active: set[int] = set()
    for node in reversed(list(tree.depth_first())):
        runs_or_active = states.states[node.uid] == RUNNING or node.uid in active
        if runs_or_active and node.parent is not None:
            active.add(node.parent)
    return active


def _hidden_in(tree: NodeList, top: DescribedNode, folded: set[int], hidden_below: dict[int, int]) -> int:
    """How many nodes under ``top`` are hidden already: those below the highest folded nodes."""
    hidden, pending = 0, list(tree.children(top.uid))
    while pending:
        node = pending.pop()
        if node.uid in folded:
            hidden += hidden_below[node.uid]
        else:
            pending.extend(tree.children(node.uid))
    return hidden
