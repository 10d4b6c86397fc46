"""The tree as a graph whose nodes take the colour of their state, and the states as lanes over time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bestman_bt.engine.logs.btlog import Transition
from bestman_bt.engine.status import IDLE
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import LOOKS, STATE_NAMES, Color, appearance_of
from bestman_bt.records.states import NodeStates
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.rerun import entities

if TYPE_CHECKING:
    import rerun as rr

# A tidy left-to-right drawing of a tree.
# Subtrees are packed by their contours, as in Reingold and Tilford, "Tidier Drawings of Trees" (1981), with the root on
# the left and one column per depth: labels are wide and flat, so this is far more compact than top-down. A node with
# one child, as every decorator, stands right above it in the same column: behavior trees have long chains of these,
# which would else make the drawing wide and empty.


Point = tuple[float, float]


@dataclass(frozen=True)
class LabelSizes:
    """Sizes in the units of the drawing (points at zoom 1); ``family_gap``: between subtrees, in rows."""

    character_width: float = 6.2
    label_padding: float = 14.0
    row_height: float = 27.0
    column_gap: float = 40.0
    chain_indent: float = 8.0
    family_gap: float = 0.3

    def width(self, label: str) -> float:
        """Return the width of a label in its box."""
        return self.character_width * len(label) + self.label_padding


@dataclass(frozen=True)
class TreeLayout:
    """``centers``: uid → (x, y) of the node's label, y downwards. ``size``: (width, height) from the origin."""

    centers: Mapping[int, Point]
    size: Point


def tidy_layout(tree: NodeList, labels: Mapping[int, str], sizes: LabelSizes = LabelSizes()) -> TreeLayout:
    """Place every node without overlapping labels. ``labels``: uid → text."""
    columns, steps = _columns(tree)
    rows = _rows(tree, sizes.family_gap)
    extents = {uid: steps[uid] * sizes.chain_indent + sizes.width(text) for uid, text in labels.items()}
    column_widths: dict[int, float] = {}
    for uid, column in columns.items():
        column_widths[column] = max(column_widths.get(column, 0.0), extents[uid])
    lefts, left = {}, 0.0
    for column in sorted(column_widths):
        lefts[column] = left
        left += column_widths[column] + sizes.column_gap
    top = min(rows.values())
    centers = {
        uid: (lefts[columns[uid]] + extents[uid] - sizes.width(text) / 2, (rows[uid] - top + 0.5) * sizes.row_height)
        for uid, text in labels.items()
    }
    height = (max(rows.values()) - top + 1.0) * sizes.row_height
    return TreeLayout(centers, (left - sizes.column_gap, height))


def _columns(tree: NodeList) -> tuple[dict[int, int], dict[int, int]]:
    """Return, by uid, the column and the number of nodes above it in its chain."""
    columns: dict[int, int] = {}
    steps: dict[int, int] = {}
    for node in tree:
        if node.parent is None:
            columns[node.uid], steps[node.uid] = 0, 0
        elif len(tree.children(node.parent)) == 1:
            columns[node.uid], steps[node.uid] = columns[node.parent], steps[node.parent] + 1
        else:
            columns[node.uid], steps[node.uid] = columns[node.parent] + 1, 0
    return columns, steps


@dataclass
class _Contour:
    """Lowest and highest row per column, relative to the top node of a subtree."""

    low: list[float]
    high: list[float]

    def shifted(self, shift: float) -> _Contour:
        return _Contour([row + shift for row in self.low], [row + shift for row in self.high])


def _rows(tree: NodeList, family_gap: float) -> dict[int, float]:
    contours: dict[int, _Contour] = {}
    offsets: dict[int, float] = {tree[0].uid: 0.0}
    for node in reversed(list(tree.depth_first())):
        children = [child.uid for child in tree.children(node.uid)]
        if not children:
            contours[node.uid] = _Contour([0.0], [0.0])
        elif len(children) == 1:
            offsets[children[0]] = 1.0
            contour = contours.pop(children[0]).shifted(1.0)
            contour.low[0] = 0.0
            contours[node.uid] = contour
        else:
            merged, shifts = _side_by_side([contours.pop(child) for child in children], family_gap)
            centre = (shifts[0] + shifts[-1]) / 2
            for child, shift in zip(children, shifts, strict=True):
                offsets[child] = shift - centre
            merged = merged.shifted(-centre)
            contours[node.uid] = _Contour([0.0, *merged.low], [0.0, *merged.high])
    rows: dict[int, float] = {}
    for node in tree.depth_first():
        rows[node.uid] = offsets[node.uid] + (0.0 if node.parent is None else rows[node.parent])
    return rows


def _side_by_side(contours: list[_Contour], family_gap: float) -> tuple[_Contour, list[float]]:
    """Pack subtrees below one another as closely as their contours allow; return the union, and how far each moved."""
    merged = contours[0]
    shifts = [0.0]
    before = contours[0]
    for contour in contours[1:]:
        both_leaves = _is_leaf(before) and _is_leaf(contour)
        distance = 1.0 if both_leaves else 1.0 + family_gap
        shift = max(high - low for high, low in zip(merged.high, contour.low, strict=False)) + distance
        shifts.append(shift)
        moved = contour.shifted(shift)
        deeper = len(moved.low)
        merged = _Contour(merged.low + moved.low[len(merged.low) :], moved.high + merged.high[deeper:])
        before = contour
    return merged, shifts


def _is_leaf(contour: _Contour) -> bool:
    return len(contour.low) == 1 and contour.low[0] == contour.high[0]


class TreeGraph:
    """Writes the layout of a tree once, and afterwards only changes of colours."""

    def __init__(self, recording: rr.RecordingStream, tree: NodeList) -> None:
        self._recording = recording
        self._tree = tree
        self._colors: list[Color] = []

    @staticmethod
    def layout(tree: NodeList) -> TreeLayout:
        """Return the positions of the nodes."""
        return tidy_layout(tree, {node.uid: node_label(node) for node in tree})

    def write_shape(self) -> None:
        """Write nodes, labels, positions and edges."""
        import rerun as rr

        centers = self.layout(self._tree).centers
        self._recording.log(
            entities.TREE_GRAPH,
            rr.GraphNodes(
                node_ids=[str(node.uid) for node in self._tree],
                positions=[centers[node.uid] for node in self._tree],
                labels=[node_label(node) for node in self._tree],
                show_labels=True,
            ),
            rr.GraphEdges(
                edges=[(str(node.parent), str(node.uid)) for node in self._tree if node.parent is not None],
                graph_type="directed",
            ),
            static=True,
        )

    def write_colors(self, states: NodeStates) -> None:
        """Write the colours of this moment, if they differ from those written last."""
        import rerun as rr

        colors = [appearance_of(states, node.uid).dark for node in self._tree]
        if colors != self._colors:
            self._recording.log(entities.TREE_GRAPH, rr.GraphNodes.from_fields(colors=colors))
            self._colors = colors


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
    """Return uid → entity path of the node's lane, in depth-first order."""
    return {
        node.uid: entities.lane_entity(position, node_label(node)) for position, node in enumerate(tree.depth_first())
    }
