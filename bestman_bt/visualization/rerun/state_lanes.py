"""A lane per node that shows over time when it ran and how it ended."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from bestman_bt.engine.logs.btlog import Transition
from bestman_bt.engine.status import IDLE
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import LOOKS, STATE_NAMES
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.rerun import entities

if TYPE_CHECKING:
    import rerun as rr

NO_STATE = ""


class StateLanes:
    """Writes state changes node by node.

    Within one tick only the last state counts, but a result that is cleared in the tick that brought it stays
    until the next one: else a condition that is checked at every tick would leave an empty lane.
    """

    def __init__(self, recording: rr.RecordingStream, tree: NodeList) -> None:
        self._recording = recording
        self._lanes = lane_entities(tree)
        self._shown = dict.fromkeys(self._lanes, NO_STATE)
        self._due_for_reset: set[int] = set()

    def write_styles(self) -> None:
        """Write the colours of the states and an empty lane for every node, so that the lanes keep the order of the
        tree.
        """
        import rerun as rr

        shown = {state: look for state, look in LOOKS.items() if state != IDLE}
        style = rr.StateConfiguration(
            values=[STATE_NAMES[state].upper() for state in shown],
            labels=[look.word for look in shown.values()],
            colors=[look.dark for look in shown.values()],
        )
        for lane in self._lanes.values():
            self._recording.log(lane, style, static=True)

    def write(self, transitions: Iterable[Transition]) -> None:
        """Write the changes of one tick, at the time that is set on the recording."""
        reached: dict[int, str] = dict.fromkeys(self._due_for_reset, NO_STATE)
        self._due_for_reset = set()
        for transition in transitions:
            if transition.status != IDLE:
                reached[transition.uid] = STATE_NAMES[transition.status].upper()
                self._due_for_reset.discard(transition.uid)
            elif reached.get(transition.uid):
                self._due_for_reset.add(transition.uid)
            else:
                reached[transition.uid] = NO_STATE
        for uid, state in reached.items():
            self._show(uid, state)

    def _show(self, uid: int, state: str) -> None:
        import rerun as rr

        if self._shown[uid] != state:
            self._recording.log(self._lanes[uid], rr.StateChange(state=state))
            self._shown[uid] = state


def lane_entities(tree: NodeList) -> dict[int, str]:
    """uid → entity path of the node's lane, in reading order of the tree."""
    return {
        node.uid: entities.lane_entity(position, node_label(node)) for position, node in enumerate(tree.depth_first())
    }
