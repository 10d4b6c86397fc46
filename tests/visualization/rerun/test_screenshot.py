from __future__ import annotations

import ctypes.util
import io

import numpy as np
import pytest
from PIL import Image

from bestman_bt.engine import FAILURE, RUNNING
from bestman_bt.messages import Pose
from bestman_bt.records.palette import LOOKS
from bestman_bt.visualization import RobotSnapshot, ScreenshotError
from bestman_bt.visualization.rerun import ScreenshotParameters, take_screenshots
from tests.visualization.conftest import changed

needs_vulkan = pytest.mark.skipif(
    ctypes.util.find_library("vulkan") is None,
    reason="the headless viewer needs libvulkan1 and a driver (Debian: libvulkan1 mesa-vulkan-drivers)",
)
QUICK = ScreenshotParameters(size=(1280, 800), settle=1.5)


def pixels_near(picture: np.ndarray, color: tuple[int, int, int]) -> int:
    return int(np.sum(np.abs(picture.astype(int) - color).max(axis=-1) < 12))


@needs_vulkan
def test_a_picture_shows_the_states_of_its_moment_and_no_view_complains(record, tmp_path):
    with record(cameras={}) as recorder:
        for k in range(30):
            recorder.snapshot(RobotSnapshot(0.1 * k, k, Pose(), {"arm_shoulder": 0.1, "arm_slide": 0.1}))
        recorder.changes(changed(1.0, *((uid, RUNNING) for uid in range(1, 11)), tick=10))
        recorder.changes(changed(2.0, *((uid, FAILURE, "no") for uid in range(1, 11)), tick=20))
    shots = take_screenshots(tmp_path / "run.rrd", [1.5, 2.5], QUICK)
    early, late = (np.array(Image.open(io.BytesIO(shot.png)).convert("RGB")) for shot in shots)
    assert early.shape == (800, 1280, 3)
    assert [shot.reports for shot in shots] == [(), ()]
    running, failed = LOOKS[RUNNING].dark, LOOKS[FAILURE].dark
    tree = (slice(40, 470), slice(645, 1280))
    assert pixels_near(early[tree], running) > 100 > 10 > pixels_near(early[tree], failed)
    assert pixels_near(late[tree], failed) > 100 > 10 > pixels_near(late[tree], running)
    table = np.array([179, 128, 77])
    scene = early[40:470, :635].astype(float)
    directions = scene / np.maximum(1.0, np.linalg.norm(scene, axis=-1, keepdims=True))
    assert np.sum(directions @ (table / np.linalg.norm(table)) > 0.995) > 500


def test_a_recording_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(ScreenshotError, match=r"there is no recording .*none\.rrd"):
        take_screenshots(tmp_path / "none.rrd", [0.0])
