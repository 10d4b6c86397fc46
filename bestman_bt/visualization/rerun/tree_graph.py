"""The tree as a graph whose nodes take the colour of their state."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bestman_bt.records.nodes import NodeList
from bestman_bt.records.palette import Color, look_of
from bestman_bt.records.states import NodeStates
from bestman_bt.visualization.node_labels import node_label
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.tree_layout import TreeLayout, tidy_layout

if TYPE_CHECKING:
    import rerun as rr


class TreeGraph:
    """Writes the shape of a tree once and afterwards only the colours that it takes."""

    def __init__(self, recording: rr.RecordingStream, tree: NodeList) -> None:
        self._recording = recording
        self._tree = tree
        self._colors: list[Color] = []

    @staticmethod
    def layout(tree: NodeList) -> TreeLayout:
        """Where the nodes are drawn."""
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

        colors = [look_of(states, node.uid).dark for node in self._tree]
        if colors != self._colors:
            self._recording.log(entities.TREE_GRAPH, rr.GraphNodes.from_fields(colors=colors))
            self._colors = colors
