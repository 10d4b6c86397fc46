"""Rerun recordings of runs; rerun itself is imported when a recording is opened."""

from bestman_bt.visualization.rerun.blueprint import Eye, eye_on
from bestman_bt.visualization.rerun.recorder import RecordedCamera, RerunRecorder
from bestman_bt.visualization.rerun.screenshot import Screenshot, ScreenshotParameters, take_screenshots
from bestman_bt.visualization.rerun.sensed import SensorRecording

__all__ = [
    "Eye",
    "RecordedCamera",
    "RerunRecorder",
    "Screenshot",
    "ScreenshotParameters",
    "SensorRecording",
    "eye_on",
    "take_screenshots",
]
