"""Errors of displaying or recording a run."""

from __future__ import annotations

from bestman_bt.errors import Error


class VisualizationError(Error):
    """Base of the errors of this package."""


class RecordingError(VisualizationError):
    """A recording cannot be written, or cannot show the given data."""


class ViewerError(VisualizationError):
    """The viewer cannot be started."""
