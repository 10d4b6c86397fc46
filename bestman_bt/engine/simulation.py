"""Runs a tree in simulated time, for tests: no waiting, the same result on any machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bestman_bt.engine.authoring import build_tree
from bestman_bt.engine.clock import ManualClock
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.status import RUNNING, SUCCESS
from bestman_bt.engine.core.tree import StateChanges, Tree
from bestman_bt.engine.loading import load_tree
from bestman_bt.engine.registry import NodeRegistry
from bestman_bt.engine.substitution import SubstitutionRules


@dataclass(frozen=True)
class SimulatedRun:
    """What a run gave: the last status, the simulated seconds, the state changes as (time, path, state), the tree."""

    status: int
    seconds: float
    changes: list[tuple[float, str, int]]
    tree: Tree

    @property
    def succeeded(self) -> bool:
        """Whether the tree ended with SUCCESS."""
        return self.status == SUCCESS

    def visited(self, path: str) -> bool:
        """Return whether the node with this path ever left IDLE."""
        return any(found == path for _, found, _ in self.changes)


def simulate(
    source: str | Path | Node,
    registry: NodeRegistry | None = None,
    *,
    entries: Mapping[str, Any] | None = None,
    context: Any = None,
    substitutions: SubstitutionRules | None = None,
    period: float = 0.05,
    limit: float = 600.0,
) -> SimulatedRun:
    """Load a tree, tick it until it ends, and return what happened.

    Args:
        source: a file, XML text, or the root of a tree made in Python.
        registry: the nodes that it may name.
        entries: root entries that are set before the first tick.
        context: handed to the nodes.
        substitutions: nodes to be replaced, for instance by TestNodes with delays.
        period: simulated seconds between ticks.
        limit: simulated seconds after which the tree is halted; its status is then RUNNING.
    """
    clock = ManualClock()
    if isinstance(source, Node):
        tree = build_tree(source, registry=registry, context=context, clock=clock, substitutions=substitutions)
    else:
        tree = load_tree(source, registry, context=context, clock=clock, substitutions=substitutions)
    for key, value in (entries or {}).items():
        tree.blackboard.set(key, value)
    changes: list[tuple[float, str, int]] = []

    def listen(batch: StateChanges) -> None:
        changes.extend((batch.stamp, tree.nodes[uid - 1].path, state) for uid, state in batch)

    tree.subscribe(listen)
    status = tree.tick_while_running(period, max_ticks=max(1, round(limit / period)))
    if status == RUNNING:
        tree.halt()
    tree.unsubscribe(listen)
    return SimulatedRun(status, clock.now(), changes, tree)
