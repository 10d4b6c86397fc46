"""Views of a run: Rerun recordings and the live tree on a terminal."""

from bestman_bt.visualization.errors import RecordingError, ScreenshotError, ViewerError, VisualizationError
from bestman_bt.visualization.snapshot import RecordedBody, RobotSnapshot

__all__ = [
    "RecordedBody",
    "RecordingError",
    "RobotSnapshot",
    "ScreenshotError",
    "ViewerError",
    "VisualizationError",
]
