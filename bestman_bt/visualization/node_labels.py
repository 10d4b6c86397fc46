"""Short labels of nodes: the name, preceded by the common symbol of control nodes and decorators."""

from __future__ import annotations

from bestman_bt.records.events import DescribedNode

SYMBOLS = {
    "Sequence": "→",
    "AsyncSequence": "→",
    "SequenceWithMemory": "→*",
    "ReactiveSequence": "⇒",
    "Fallback": "?",
    "AsyncFallback": "?",
    "ReactiveFallback": "⁇",
    "Parallel": "||",
    "ParallelAll": "||",
    "Inverter": "¬",
    "ForceSuccess": "✓",
    "ForceFailure": "✗",
    "Repeat": "↻",
    "RetryUntilSuccessful": "↻",
    "KeepRunningUntilFailure": "↻",
}
"""→ sequence and ? fallback as in Colledanchise and Ögren, "Behavior Trees in Robotics and AI" (2018).

Only characters of Rerun's font (Inter): its headless viewer stops at any other.
"""


def node_label(node: DescribedNode) -> str:
    """Return the label of a node: ``"→ pick"`` for a named Sequence, ``"→ Sequence"`` for an unnamed one; for a leaf
    its name, else its type."""
    symbol = SYMBOLS.get(node.type)
    text = node.name or node.type
    return f"{symbol} {text}" if symbol else text
