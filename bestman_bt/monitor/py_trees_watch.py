"""Watches a tree of py_trees from inside its process, by handlers around its ticks."""

from __future__ import annotations

import atexit
import os
import threading
import time
from pathlib import Path

from py_trees.behaviour import Behaviour
from py_trees.blackboard import Blackboard
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator
from py_trees.trees import BehaviourTree

from bestman_bt.engine.models.node_models import LIKE_CONDITIONS
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS
from bestman_bt.errors import Error
from bestman_bt.monitor.control_socket import Request, RequestRefusedError
from bestman_bt.monitor.watched import WatchedExecution
from bestman_bt.records.described_tree import xml_of
from bestman_bt.records.events import (
    BlackboardEvent,
    Category,
    DescribedNode,
    LogEvent,
    PausedEvent,
    ResumedEvent,
    RunEvent,
    ShownEntry,
    TreeEvent,
)
from bestman_bt.records.shown_value import REMOVED, show_value

MOST_NODES = 2**16 - 1
"""A ``.btlog`` numbers nodes by 16 bits."""
BLACKBOARD_PERIOD = 0.5
"""Seconds between two reads of the blackboard, at the end of a tick."""
LONGEST_MESSAGE = 2000
_STATES = {Status.INVALID: IDLE, Status.RUNNING: RUNNING, Status.SUCCESS: SUCCESS, Status.FAILURE: FAILURE}


class PyTreesWatchError(Error):
    """A tree cannot be watched."""


class PyTreesWatch:
    """The watch of ``bestman_bt.monitor.watch``. If the tree's nodes change, another run starts."""

    def __init__(self, tree: BehaviourTree, name: str, runs: Path | None) -> None:
        self._tree, self._name, self._runs = tree, name, runs
        self._pace = threading.Condition()
        self._is_paused, self._steps = False, 0
        self._nodes: list[Behaviour] = []
        self._entries: dict[str, ShownEntry] = {}
        self._shown: WatchedExecution | None = None
        self._begin()
        tree.add_pre_tick_handler(self._before)
        tree.add_post_tick_handler(self._after)
        atexit.register(self.close)

    def close(self) -> None:
        """Stop watching; the tree continues."""
        if self._shown is None:
            return
        atexit.unregister(self.close)
        self._tree.pre_tick_handlers.remove(self._before)
        self._tree.post_tick_handlers.remove(self._after)
        self._end("the watching ended")
        self._control({"do": "resume"})

    def __enter__(self) -> PyTreesWatch:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _begin(self) -> None:
        self._nodes = _depth_first(self._tree.root)
        if len(self._nodes) > MOST_NODES:
            raise PyTreesWatchError(f"the tree has {len(self._nodes)} nodes; at most {MOST_NODES} can be watched")
        described = _described(self._nodes)
        name = self._name or self._tree.root.name
        self._statuses = [Status.INVALID] * len(self._nodes)
        self._order = _order_of_ticks(described)
        self._began, self._looked = time.monotonic(), 0.0
        run = RunEvent(
            name, name, "", "", 0, "", os.getpid(), time.time(), 0.0, "real", source=f"py_trees process {os.getpid()}"
        )
        tree = TreeEvent(described, xml_of(described, name), name)
        try:
            self._shown = WatchedExecution(run, tree, self._runs, self._control)
        except OSError as error:
            raise PyTreesWatchError(f"{self._runs}: no run folder can be made there: {error.strerror}") from error
        self._shown.__enter__()
        self._entries = {}

    def _now(self) -> float:
        return round(time.monotonic() - self._began, 6)

    def _end(self, why: str) -> None:
        shown, self._shown = self._shown, None
        if shown is not None:
            self._look_at_blackboard(shown, self._now())
            shown.end(why)
            shown.__exit__(None, None, None)

    def _before(self, tree: BehaviourTree) -> None:
        """Wait while a pause is requested."""
        with self._pace:
            if not self._is_paused or self._shown is None:
                return
            shown = self._shown
            if self._steps:
                self._steps -= 1
                return
            shown.publish(PausedEvent(shown.standing.time, "asked"))
            self._pace.wait_for(lambda: not self._is_paused or self._steps > 0)
            self._steps = max(0, self._steps - 1)
            shown.publish(ResumedEvent(shown.standing.time))

    def _after(self, tree: BehaviourTree) -> None:
        """Publish the changes of the tick."""
        nodes = _depth_first(tree.root)
        if nodes != self._nodes:
            self._end("its nodes were changed")
            self._begin()
        shown = self._shown
        if shown is None:
            return
        now, before = self._now(), self._statuses
        self._statuses = [node.status for node in self._nodes]
        changed = [at for at, (one, other) in enumerate(zip(self._statuses, before, strict=True)) if one is not other]
        changed.sort(key=self._order.__getitem__)
        changes = [(at + 1, _STATES[self._statuses[at]]) for at in changed]
        messages = {
            uid: str(self._nodes[uid - 1].feedback_message)[:LONGEST_MESSAGE]
            for uid, state in changes
            if state != IDLE and self._nodes[uid - 1].feedback_message
        }
        shown.publish_states(now, changes, messages)
        for uid, state in changes:
            node = shown.tree.nodes[uid - 1]
            if state == FAILURE and node.category == "action":
                shown.publish(LogEvent(now, "warning", messages.get(uid, "failed"), node=node.path))
        if now - self._looked >= BLACKBOARD_PERIOD:
            self._looked = now
            self._look_at_blackboard(shown, now)

    def _look_at_blackboard(self, shown: WatchedExecution, now: float) -> None:
        entries = {key.removeprefix("/"): show_value(value) for key, value in list(Blackboard.storage.items())}
        news = {key: entry for key, entry in entries.items() if self._entries.get(key) != entry}
        news |= {key: REMOVED for key in self._entries if key not in entries}
        self._entries = entries
        if news:
            shown.publish(BlackboardEvent(now, shown.standing.tick, {"": news}))

    def _control(self, asked: Request) -> None:
        what = asked.get("do")
        if what not in ("pause", "resume", "step"):
            raise RequestRefusedError(f"a tree of py_trees can be paused and stepped from here, not {str(what)[:40]!r}")
        with self._pace:
            self._is_paused = what != "resume"
            self._steps += what == "step"
            self._pace.notify_all()


def _depth_first(root: Behaviour) -> list[Behaviour]:
    """Return parents before children; ``iterate`` of py_trees returns them after, and is recursive."""
    found, pending = [], [root]
    while pending:
        node = pending.pop()
        found.append(node)
        if node.children:
            pending += reversed(node.children)
    return found


def _order_of_ticks(nodes: list[DescribedNode]) -> list[int]:
    """Return the order in which nodes finish in a tick, by index: children first, from left to right."""
    below = [0] * (len(nodes) + 1)
    depths = [0] * (len(nodes) + 1)
    for node in reversed(nodes):
        below[node.parent or 0] += below[node.uid] + 1
    for node in nodes:
        depths[node.uid] = depths[node.parent] + 1 if node.parent else 0
    return [node.uid - 1 + below[node.uid] - depths[node.uid] for node in nodes]


def _described(nodes: list[Behaviour]) -> list[DescribedNode]:
    uids = {id(node): uid for uid, node in enumerate(nodes, 1)}
    described_nodes: list[DescribedNode] = []
    paths: dict[int, str] = {}
    known: set[str] = set()
    for uid, node in enumerate(nodes, 1):
        parent = None if node.parent is None else uids.get(id(node.parent))
        above = f"{paths[parent]}/" if parent is not None else ""
        name = str(node.name)
        path = f"{above}{name}"
        paths[uid] = path if path not in known else f"{path}::{uid}"
        known.add(paths[uid])
        described_nodes.append(
            DescribedNode(uid, parent, name, type(node).__name__, _category(node), paths[uid], {}, "")
        )
    return described_nodes


def _category(node: Behaviour) -> Category:
    if isinstance(node, Decorator):
        return "decorator"
    if isinstance(node, Composite) or node.children:
        return "control"
    return "condition" if type(node).__name__.startswith(LIKE_CONDITIONS) else "action"
