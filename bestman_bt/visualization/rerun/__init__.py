"""Rerun recordings of runs; rerun itself is imported when a recording is opened."""

from bestman_bt.visualization.rerun.blueprint import Eye, eye_on
from bestman_bt.visualization.rerun.open_recording import RecordedCamera, RecordingSetup
from bestman_bt.visualization.rerun.recorder import RECORDING_NAME, RerunRecorder
from bestman_bt.visualization.rerun.sensed import SensorRecording
from bestman_bt.visualization.rerun.viewer import (
    Display,
    LiveFeed,
    RerunViewer,
    ViewerOptions,
    check_recording,
    has_window_system,
)

__all__ = [
    "RECORDING_NAME",
    "Display",
    "Eye",
    "LiveFeed",
    "RecordedCamera",
    "RecordingSetup",
    "RerunRecorder",
    "RerunViewer",
    "SensorRecording",
    "ViewerOptions",
    "check_recording",
    "eye_on",
    "has_window_system",
]
