"""Monitoring of executors: their events, the live page, Groot2. Executors are accessed only through sockets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from py_trees.trees import BehaviourTree

    from bestman_bt.monitor.py_trees_watch import PyTreesWatch

__all__ = ["watch"]


def watch(tree: BehaviourTree, name: str = "", runs: str | Path | None = "runs") -> PyTreesWatch:
    """Show an unmodified py_trees tree on the live page (``bestman-bt monitor``) and record it in a run folder.

    Args:
        tree: ticked by ``tree.tick()`` or ``tick_tock`` as before.
        name: the name of the run; the root's name by default.
        runs: the folder that receives the run folder; None records nothing.

    Returns:
        The watch, a context manager; it ends with ``close``, at the latest at the end of the program.

    Raises:
        PyTreesWatchError: the tree has too many nodes, or the folder cannot be made.
    """
    from bestman_bt.monitor.py_trees_watch import PyTreesWatch

    return PyTreesWatch(tree, name, None if runs is None else Path(runs))
