"""What goes wrong when a run is shown or recorded."""

from __future__ import annotations

from bestman_bt.errors import Error


class VisualizationError(Error):
    """Base of the errors of this package."""


class RecordingError(VisualizationError):
    """A recording cannot be written, or was given something that it cannot show."""


class ViewerError(VisualizationError):
    """The viewer cannot be started."""


class ScreenshotError(VisualizationError):
    """No picture of a recording could be taken."""
