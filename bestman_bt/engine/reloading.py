"""Reloading: a tree whose files are read again while it runs; running nodes continue in the new tree."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from bestman_bt.engine.authoring import build_tree
from bestman_bt.engine.core.node import Node
from bestman_bt.engine.core.tree import Tree
from bestman_bt.engine.leaves.base import StatefulAction
from bestman_bt.engine.status import IDLE, RUNNING
from bestman_bt.errors import Error

_LOG = logging.getLogger(__name__)

Load = Callable[[Tree | None], Tree]
"""Loads the tree again; with a tree, on its blackboards (``LoadOptions.replaces``)."""


class WatchedTree(StatefulAction):
    """Ticks a tree from XML and reloads it between two ticks if its files change.

    The new tree is accepted if all running nodes keep path, type, ports, and their index among their siblings. They
    continue; all other nodes start from the beginning; blackboard entries are kept. Otherwise the old tree continues,
    and the new one is tried again before each tick. ``taken``: called with a description of each reload.
    """

    def __init__(self, tree: Tree, load: Load, taken: Callable[[str], None]) -> None:
        super().__init__(name=tree.tree_id)
        self.current = tree
        self._load, self._taken = load, taken
        self._seen = _stamps(tree)
        self._waiting: Tree | None = None
        self._reported = ""

    def on_start(self) -> int:
        """Start the tree."""
        self._announce()
        return self.on_running()

    def on_running(self) -> int:
        """Tick the tree, or its reloaded version."""
        self._look()
        status = self.current.tick_exactly_once()
        running = [node.name for node in self.current.nodes if node.state == RUNNING and not node.children]
        self.feedback_message = ", ".join(running)
        return status

    def on_halted(self) -> None:
        """Halt the tree."""
        self.current.halt()

    def on_stopping(self) -> int:
        """Wait for actions of the tree that are still stopping."""
        self.current.stopping.ask(self.clock.now())
        return RUNNING if self.current.stopping.until else IDLE

    def _look(self) -> None:
        stamps = _stamps(self.current)
        if stamps != self._seen:
            self._seen, self._waiting, self._reported = stamps, None, ""
            try:
                self._waiting = self._load(None)
            except Error as error:
                _LOG.error("the changed tree is not taken, the old one continues: %s", error)
        if self._waiting is None:
            return
        why = "; ".join(obstacles(self.current, self._waiting))
        if why:
            if why != self._reported:
                _LOG.warning("the changed tree waits: %s", why)
            self._reported = why
            return
        try:
            self._take(self._load(self.current))
        except Error as error:
            _LOG.error("the changed tree is not taken, the old one continues: %s", error)
        self._waiting = None

    def _take(self, new: Tree) -> None:
        old = self.current
        old.publish_idle()
        kept = take_over(old, new)
        self.current = new
        self.owner.blackboards = dict(new.blackboards)
        self._seen = _stamps(new)
        self._announce()
        self._taken(f"{new.file} was read again: {kept} of its {len(new.nodes)} nodes were running and continue")

    def _announce(self) -> None:
        self.current.wake_with(self.owner)
        self.owner.announce_inner(self.current, self)


def watched(tree: Tree, load: Load, taken: Callable[[str], None]) -> Tree:
    """Return a tree of one ``WatchedTree`` on the blackboards of ``tree``."""
    root = WatchedTree(tree, load, taken)
    root.line = 0  # it comes from no line of a file
    outer = build_tree(
        root, registry=tree.registry, tree_id=tree.tree_id, file=tree.file, context=tree.context, clock=tree.clock,
        blackboard=tree.blackboard,
    )  # fmt: skip
    outer.blackboards = dict(tree.blackboards)
    return outer


def _stamps(tree: Tree) -> set[tuple[str, int]]:
    """Return the files of a tree's nodes, each with the time of its last change; 0 if it is gone."""
    files = {tree.file, *(node.place.file for node in tree.nodes if node.place is not None)}
    return {(file, Path(file).stat().st_mtime_ns if Path(file).is_file() else 0) for file in files}


def obstacles(old: Tree, new: Tree) -> Iterator[str]:
    """Yield each reason why ``new`` cannot replace ``old`` now."""
    for leaf in old.stopping.until:
        yield f"{leaf.where or leaf.path} is still stopping"
    there = {node.path: node for node in new.nodes}
    for node in old.nodes:
        if node.state != RUNNING:
            continue
        found, named = there.get(node.path), node.where or node.path
        if found is None:
            yield f"{named} is running, and the new tree has no node '{node.path}'"
        elif found.type_id != node.type_id:
            yield f"{named} is running, and is now of the type {found.type_id}"
        elif found.attributes != node.attributes:
            yield f"{named} is running, and its ports have changed"
        elif _place_of(found) != _place_of(node):
            yield f"{named} is running, and has another place"


def _place_of(node: Node) -> tuple[str, int] | None:
    """Return the parent's path, and which of its children a node is."""
    parent = node.parent
    if not isinstance(parent, Node):
        return None
    return parent.path, next(index for index, child in enumerate(parent.children) if child is node)


def take_over(old: Tree, new: Tree) -> int:
    """Move the running nodes of ``old`` and the states of the other nodes into ``new``. Returns the number of nodes
    that continue.

    Requires that ``new`` was loaded with ``replaces=old`` and that ``obstacles`` yields nothing.
    """
    before = {node.path: node for node in old.nodes}
    other: dict[Any, Node] = {}
    for node in new.nodes:
        found = before.get(node.path)
        if found is None or found.type_id != node.type_id:
            continue
        if found.state != RUNNING:
            node._s = found._s
            continue
        other[node], other[found] = found, node
        for name in ("uid", "line", "place", "children"):
            mine, its = getattr(node, name), getattr(found, name)
            setattr(node, name, its)
            setattr(found, name, mine)
    for tree in (old, new):
        tree.nodes[:] = [other.get(node, node) for node in tree.nodes]
        for node in tree.nodes:
            for index, child in enumerate(node.children):
                node.children[index] = other.get(child, child)
                node.children[index].parent = node
        for node in tree.nodes:
            node.order = None
        tree.complete(tree.nodes[0], 0, tree.shared)
    return len(other) // 2
