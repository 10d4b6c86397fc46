"""Viewers are started for this machine only, see a run while it happens, and say why they do not start."""

from __future__ import annotations

import ctypes.util
import io
import socket
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from bestman_bt.engine import RUNNING
from bestman_bt.messages import Pose
from bestman_bt.records.palette import LOOKS
from bestman_bt.visualization.errors import RecordingError
from bestman_bt.visualization.rerun.open_recording import RecordingSetup
from bestman_bt.visualization.rerun.recorder import RerunRecorder
from bestman_bt.visualization.rerun.viewer import Display, LiveFeed, RerunViewer, ViewerOptions, check_recording
from bestman_bt.visualization.snapshot import RobotSnapshot
from tests.visualization.conftest import changed

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

needs_vulkan = pytest.mark.skipif(
    ctypes.util.find_library("vulkan") is None,
    reason="the headless viewer needs libvulkan1 and a driver (Debian: libvulkan1 mesa-vulkan-drivers)",
)


@contextmanager
def viewer(options: ViewerOptions, *recordings: Path) -> Iterator[RerunViewer]:
    with tempfile.TemporaryFile("w+") as output:
        started = RerunViewer(options, recordings, output)
        try:
            yield started
        finally:
            started.stop()


def test_a_page_is_served_to_this_machine_only() -> None:
    with viewer(ViewerOptions(Display.BROWSER)) as serving:
        with urllib.request.urlopen(serving.page, timeout=5.0) as answer:
            assert b"rerun" in answer.read().lower()
        for port in (serving.port, serving.page_port):
            with pytest.raises(ConnectionRefusedError):
                socket.create_connection(("127.0.0.2", port), 2.0)


@needs_vulkan
def test_a_run_is_seen_while_it_is_recorded(tmp_path, robot_urdf, fetch_tree) -> None:
    from rerun.experimental import ViewerClient

    file = tmp_path / "run.rrd"
    recorder = RerunRecorder(file, RecordingSetup(robot_urdf, "floor_point", fetch_tree))
    with viewer(ViewerOptions(Display.BROWSER, fed=True)) as page, LiveFeed(file, page.pipe), recorder:
        page.wait_until_up(30.0)
        with viewer(ViewerOptions(Display.NONE, source=page.address, size=(1280, 800))) as showing:
            client = ViewerClient.connect(showing.address)
            recorder.snapshot(RobotSnapshot(0.1, 1, Pose(), {"arm_shoulder": 0.1, "arm_slide": 0.1}))
            recorder.changes(changed(0.2, *((uid, RUNNING) for uid in range(1, 11)), tick=2))
            deadline, seen = time.monotonic() + 60.0, 0
            while seen <= 100 and time.monotonic() < deadline:
                seen = pixels_that_run(client)
            assert seen > 100
    check_recording(file)


def pixels_that_run(client: ViewerClient) -> int:
    """Of the picture that the viewer shows; 0 while it is too busy to show one."""
    try:
        png = client.take_screenshot()
    except TimeoutError:
        return 0
    picture = np.array(Image.open(io.BytesIO(png)).convert("RGB")).astype(int)
    return int(np.sum(np.abs(picture - LOOKS[RUNNING].dark).max(axis=-1) < 12))


@pytest.mark.parametrize("content", [b"", b"RRF2", b"<script>alert(1)</script>" * 50, b"RRF2" + bytes(range(256)) * 40])
def test_what_is_no_recording_is_reported(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "recording.rrd"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="Rerun recording"):
        check_recording(path)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_recording_that_was_cut_off_is_one(record, tmp_path: Path) -> None:
    with record() as recorder:
        for k in range(200):
            recorder.snapshot(RobotSnapshot(0.1 * k, k, Pose(), {"arm_shoulder": 0.01 * k, "arm_slide": 0.1}))
    whole = (tmp_path / "run.rrd").read_bytes()
    cut = tmp_path / "cut.rrd"
    cut.write_bytes(whole[: len(whole) - len(whole) // 5])
    check_recording(cut)
