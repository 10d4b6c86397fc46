"""Short labels of nodes: the symbol of the literature before the name of a control node."""

from __future__ import annotations

from bestman_bt.visualization.tree_description import DescribedNode

CONTROL_SYMBOLS = {
    "Sequence": "→",
    "AsyncSequence": "→",
    "SequenceWithMemory": "→*",
    "ReactiveSequence": "⇒",
    "Fallback": "?",
    "AsyncFallback": "?",
    "ReactiveFallback": "⁇",
    "Parallel": "⇉",
    "ParallelAll": "⇉",
}
"""→ sequence and ? fallback as in Colledanchise and Ögren, "Behavior Trees in Robotics and AI" (2018)."""


def node_label(node: DescribedNode) -> str:
    """``"→ pick"`` for a named Sequence, ``"→ Sequence"`` for a nameless one, ``"Grasp"`` or ``"Grasp: cup"`` for leaves."""
    symbol = CONTROL_SYMBOLS.get(node.type)
    if symbol:
        return f"{symbol} {node.name or node.type}"
    if not node.name or node.name == node.type:
        return node.type
    return f"{node.type}: {node.name}"
