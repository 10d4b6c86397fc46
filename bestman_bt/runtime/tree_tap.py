"""Listens to one tree for the telemetry."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

from bestman_bt.engine import RUNNING, Node, StateChanges, Tree
from bestman_bt.records.described_tree import describe_tree
from bestman_bt.records.events import MAIN_TREE, Event, StatesEvent
from bestman_bt.runtime.event_stream import Tell
from bestman_bt.runtime.failure_lines import failure_codes

LONGEST_MESSAGE = 2000
"""Characters of what a node says of itself."""
_STATE_BITS = 7


class TreeTap:
    """Tells the states of a tree and what its leaves say of themselves.

    ``tell``: takes what makes events, False where it was lost; ``moment``: from a time of the clock to time and
    ticks so far, as events have them; ``failed``: told the uids of actions that failed.
    """

    def __init__(
        self,
        tree: Tree,
        tell: Tell,
        moment: Callable[[float], tuple[float, int]],
        failed: Callable[[Tree, list[int]], None],
        number: int = MAIN_TREE,
        under: Node | None = None,
    ) -> None:
        self._tree, self._tell, self._moment, self._failed = tree, tell, moment, failed
        self._number, self._under = number, under
        leaves = [node for node in tree.nodes if not node.children]
        self._leaves = leaves
        self._speaking = frozenset(node.uid * 8 + state for node in leaves for state in (1, 2, 3))
        self._failures = failure_codes(tree)
        self._said: dict[int, str] = {}
        self._lost = False

    def attach(self) -> None:
        """Begin, with the tree and how it stands now."""
        self._tell(lambda: (self._described(),))
        self._tree.subscribe(self._listen)
        self._tell_all()

    def detach(self) -> None:
        """Listen no more."""
        self._tree.unsubscribe(self._listen)

    def look(self) -> None:
        """Tell what running leaves say now, where that is new, and all states if something was lost."""
        if self._lost:
            self._lost = False
            self._tell_all()
        said, news = self._said, {}
        for node in self._leaves:
            if node._s == RUNNING and node.feedback_message != said.get(node.uid, ""):
                news[node.uid] = said[node.uid] = node.feedback_message
        if news:
            self._states(*self._moment(self._tree.clock.now()), (), news)

    def _tell_all(self) -> None:
        nodes = self._tree.nodes
        codes = [node.uid * 8 + node.state for node in nodes]
        messages = {node.uid: node.feedback_message for node in nodes if node.feedback_message}
        self._states(*self._moment(self._tree.clock.now()), codes, messages)

    def _listen(self, changes: StateChanges) -> None:
        nodes, codes, messages = self._tree.nodes, changes.codes, {}
        for code in self._speaking.intersection(codes):
            message = nodes[(code >> 3) - 1].feedback_message
            if message:
                messages[code >> 3] = self._said[code >> 3] = message
        time, ticks = self._moment(changes.stamp)
        self._states(time, ticks + 1, codes, messages)  # of the tick under way
        if not self._failures.isdisjoint(codes):
            self._failed(self._tree, [code >> 3 for code in codes if code in self._failures])

    def _states(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> None:
        self._lost |= not self._tell(partial(self._event, time, tick, codes, messages))

    def _described(self) -> Event:
        return describe_tree(self._tree, self._number, None if self._under is None else self._under.uid)

    def _event(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> tuple[Event]:
        changes = [(code >> 3, code & _STATE_BITS) for code in codes]
        short = {uid: text[:LONGEST_MESSAGE] for uid, text in messages.items()}
        return (StatesEvent(time, tick, changes, short, self._number),)
