"""Watching executors from outside: their events, the live page, Groot2. Executors are met only through sockets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from py_trees.trees import BehaviourTree

    from bestman_bt.monitor.py_trees_watch import PyTreesWatch

__all__ = ["watch"]


def watch(tree: BehaviourTree, name: str = "", runs: str | Path | None = "runs") -> PyTreesWatch:
    """Show a tree of py_trees, unmodified, on the live page (``bestman-bt monitor``) and record it in a run folder.

    Args:
        tree: ticked by ``tree.tick()`` or ``tick_tock`` as before.
        name: what the run is called; the root's name by default.
        runs: where the run folder is made; None keeps nothing.

    Returns:
        What watches until it is closed, at the latest at the end of the program; a context manager.

    Raises:
        PyTreesWatchError: the tree has too many nodes, or the folder cannot be made.
    """
    from bestman_bt.monitor.py_trees_watch import PyTreesWatch

    return PyTreesWatch(tree, name, None if runs is None else Path(runs))
