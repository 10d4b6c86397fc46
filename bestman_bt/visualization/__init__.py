"""Views of a run: Rerun recordings and the live tree on a terminal."""

from bestman_bt.visualization.engine_tree import describe_changes, describe_tree
from bestman_bt.visualization.errors import RecordingError, ScreenshotError, ViewerError, VisualizationError
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot
from bestman_bt.visualization.tree_description import DescribedNode, NodeTransition, TreeDescription

__all__ = [
    "DescribedNode",
    "NodeTransition",
    "RecordedBody",
    "RecordingError",
    "RobotSnapshot",
    "ScreenshotError",
    "TreeDescription",
    "ViewerError",
    "VisualizationError",
    "describe_changes",
    "describe_tree",
]
