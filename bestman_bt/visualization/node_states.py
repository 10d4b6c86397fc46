"""What a node looks like now: its state, or the result that it had before it was reset, with a colour and an icon."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS
from bestman_bt.visualization.errors import VisualizationError
from bestman_bt.visualization.tree_description import NodeTransition, TreeDescription


@dataclass(frozen=True)
class NodeLook:
    """How a state is shown; ``color``: rgb, each 0 to 255; ``icon``: one character; ``word``: for plain text."""

    word: str
    icon: str
    color: tuple[int, int, int]


NEVER_TICKED = NodeLook("idle", "·", (145, 151, 163))
WAS_SUCCESS = NodeLook("succeeded", "✓", (85, 150, 108))
WAS_FAILURE = NodeLook("failed", "✗", (190, 100, 95))
WAS_RUNNING = NodeLook("halted", "◌", (175, 145, 85))
LOOKS: dict[int, NodeLook] = {
    IDLE: NEVER_TICKED,
    RUNNING: NodeLook("running", "▶", (245, 170, 45)),
    SUCCESS: NodeLook("success", "✓", (65, 190, 105)),
    FAILURE: NodeLook("failure", "✗", (235, 85, 75)),
    SKIPPED: NodeLook("skipped", "↷", (120, 140, 200)),
}
"""The look of each engine state."""

NO = NodeLook("no", "–", (150, 160, 190))
WAS_NO = NodeLook("was no", "–", (125, 133, 155))
"""A condition whose answer is no: that is its work, and no fault, unless it ended the tree."""

_LOOKS_OF_PAST = {RUNNING: WAS_RUNNING, SUCCESS: WAS_SUCCESS, FAILURE: WAS_FAILURE}


def ended_by(tree: TreeDescription, transitions: Iterable[NodeTransition]) -> int | None:
    """The leaf that ended a tree: of changes in which the root fails, the last leaf that did; else None."""
    failed = [transition.uid for transition in transitions if transition.state == FAILURE]
    leaves = [uid for uid in failed if not tree.children(uid)]
    return leaves[-1] if tree.root.uid in failed and leaves else None


class NodeStates:
    """The present state, last result and last message of every node of a tree.

    An idle node keeps the look of its last result, dimmed, as Groot2 shows it: a tree that has finished, and is
    therefore idle, still tells what happened.
    """

    def __init__(self, tree: TreeDescription) -> None:
        self._tree = tree
        self._state = {node.uid: IDLE for node in tree.nodes}
        self._before_idle = dict(self._state)
        self._message = {node.uid: "" for node in tree.nodes}
        self._ended_by: int | None = None

    def apply(self, transitions: Iterable[NodeTransition]) -> None:
        """Take over state changes, in their order; VisualizationError for an unknown node or state."""
        transitions = list(transitions)
        for transition in transitions:
            uid, state = self._tree.node(transition.uid).uid, transition.state
            if state not in LOOKS:
                raise VisualizationError(
                    f"transition of {self._tree.node(uid).name!r}: state {state} is none of {sorted(LOOKS)}"
                )
            if state == IDLE:
                if self._state[uid] != IDLE:
                    self._before_idle[uid] = self._state[uid]
            else:
                self._message[uid] = transition.message
            self._state[uid] = state
        if any(transition.uid == self._tree.root.uid and transition.state != IDLE for transition in transitions):
            self._ended_by = ended_by(self._tree, transitions)

    def tell(self, uid: int, message: str) -> None:
        """Replace the message of a node, as when a running leaf reports progress."""
        self._message[self._tree.node(uid).uid] = message

    def state(self, uid: int) -> int:
        """The engine's state of a node."""
        return self._state[uid]

    def message(self, uid: int) -> str:
        """The last message of a node; empty if it had nothing to say."""
        return self._message[uid]

    def look(self, uid: int) -> NodeLook:
        """How to show a node now."""
        state = self._state[uid]
        answers = self._tree.node(uid).condition and uid != self._ended_by
        if state == IDLE:
            before = self._before_idle[uid]
            return WAS_NO if answers and before == FAILURE else _LOOKS_OF_PAST.get(before, NEVER_TICKED)
        return NO if answers and state == FAILURE else LOOKS[state]
