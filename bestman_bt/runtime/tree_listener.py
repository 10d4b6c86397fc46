"""The states of a running tree and the feedback of its leaves, as events."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, Node, StateChanges, Tree
from bestman_bt.engine.status import state_code, uid_and_state
from bestman_bt.monitor.event_stream import Publish
from bestman_bt.records.described_tree import describe_tree
from bestman_bt.records.events import MAIN_TREE, Event, StatesEvent
from bestman_bt.runtime.failure_lines import failure_codes

LONGEST_MESSAGE = 2000
"""Largest number of characters of a node's feedback."""


class TreeListener:
    """Publishes the states of a tree and the feedback of its leaves.

    ``publish``: receives a function that creates events, and returns False if it was dropped; ``moment``: converts a
    clock time to time and tick count of events; ``failed``: called with the uids of failed actions.
    """

    def __init__(
        self,
        tree: Tree,
        publish: Publish,
        moment: Callable[[float], tuple[float, int]],
        failed: Callable[[Tree, list[int]], None],
        number: int = MAIN_TREE,
        under: Node | None = None,
    ) -> None:
        self._tree, self._publish, self._moment, self._failed = tree, publish, moment, failed
        self._number, self._under = number, under
        leaves = [node for node in tree.nodes if not node.children]
        self._leaves = leaves
        self._speaking = frozenset(
            state_code(node.uid, state) for node in leaves for state in (RUNNING, SUCCESS, FAILURE)
        )
        self._failures = failure_codes(tree)
        self._said: dict[int, str] = {}
        self._lost = False

    def attach(self) -> None:
        """Start publishing, with the tree and its current state."""
        self._publish(lambda: (self._described(),))
        self._tree.subscribe(self._listen)
        self._publish_all()

    def detach(self) -> None:
        """Stop listening."""
        self._tree.unsubscribe(self._listen)

    def look(self) -> None:
        """Publish new feedback of running leaves, and all states if events were dropped."""
        if self._lost:
            self._lost = False
            self._publish_all()
        said, news = self._said, {}
        for node in self._leaves:
            moved = node.tree is not self._tree  # into a tree that has taken the place of this one
            if node._s == RUNNING and not moved and node.feedback_message != said.get(node.uid, ""):
                news[node.uid] = said[node.uid] = node.feedback_message
        if news:
            self._states(*self._moment(self._tree.clock.now()), (), news)

    def _publish_all(self) -> None:
        nodes = self._tree.nodes
        codes = [state_code(node.uid, node.state) for node in nodes]
        messages = {node.uid: node.feedback_message for node in nodes if node.feedback_message}
        self._states(*self._moment(self._tree.clock.now()), codes, messages)

    def _listen(self, changes: StateChanges) -> None:
        nodes, codes, messages = self._tree.nodes, changes.codes, {}
        for code in self._speaking.intersection(codes):
            uid, _ = uid_and_state(code)
            message = nodes[uid - 1].feedback_message
            if message:
                messages[uid] = self._said[uid] = message
        time, ticks = self._moment(changes.stamp)
        self._states(time, ticks + 1, codes, messages)  # of the tick under way
        if not self._failures.isdisjoint(codes):
            self._failed(self._tree, [uid_and_state(code)[0] for code in codes if code in self._failures])

    def _states(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> None:
        self._lost |= not self._publish(partial(self._event, time, tick, codes, messages))

    def _described(self) -> Event:
        return describe_tree(self._tree, self._number, None if self._under is None else self._under.uid)

    def _event(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> tuple[Event]:
        changes = [uid_and_state(code) for code in codes]
        short = {uid: text[:LONGEST_MESSAGE] for uid, text in messages.items()}
        return (StatesEvent(time, tick, changes, short, self._number),)
