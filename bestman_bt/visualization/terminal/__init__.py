"""The run on a terminal: a live tree, or lines of progress where there is no terminal."""

from bestman_bt.visualization.terminal.events import NodeEvent, NodeEvents
from bestman_bt.visualization.terminal.live_tree import LiveTree, style_of

__all__ = ["LiveTree", "NodeEvent", "NodeEvents", "style_of"]
