"""Pictures of a recording without a screen: the viewer runs headless and is asked for a screenshot.

Needs a Vulkan driver; without a GPU Debian's ``libvulkan1 mesa-vulkan-drivers`` (lavapipe) do.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from bestman_bt.visualization.errors import ScreenshotError
from bestman_bt.visualization.rerun import entities

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

NEEDED_PACKAGES = "libvulkan1 mesa-vulkan-drivers"


@dataclass(frozen=True)
class ScreenshotParameters:
    """``size``: pixels; ``start_timeout``, ``settle``: seconds to wait for the viewer and for what it draws."""

    size: tuple[int, int] = (1920, 1080)
    start_timeout: float = 30.0
    settle: float = 4.0
    memory_limit: str = "2GB"


@dataclass(frozen=True)
class Screenshot:
    """``png``: the picture; ``reports``: what the viewer's views complained of."""

    png: bytes
    reports: tuple[str, ...]


def take_screenshots(
    recording: Path, stamps: Sequence[float], parameters: ScreenshotParameters | None = None
) -> list[Screenshot]:
    """One picture of ``recording`` at each of ``stamps`` (seconds of ``sim_time``); ScreenshotError if it fails."""
    chosen = parameters or ScreenshotParameters()
    if not recording.is_file():
        raise ScreenshotError(f"there is no recording {recording}")
    with tempfile.TemporaryFile("w+") as output, _headless_viewer(recording, chosen, output) as client:
        try:
            return [_take(client, stamp, chosen) for stamp in stamps]
        except (ConnectionError, RuntimeError) as error:
            raise ScreenshotError(f"the viewer failed on {recording}: {error}; it said: {_tail(output)}") from error


def _take(client: ViewerClient, stamp: float, parameters: ScreenshotParameters) -> Screenshot:
    client.set_time(entities.SIM_TIME, duration=stamp, play_state="paused")
    time.sleep(parameters.settle)
    png = client.take_screenshot()
    reports = tuple(f"{view.name}: {report.summary}" for view in client.get_state().views for report in view.reports)
    return Screenshot(png, reports)


@contextmanager
def _headless_viewer(recording: Path, parameters: ScreenshotParameters, output: TextIO) -> Iterator[ViewerClient]:
    from rerun.experimental import ViewerClient

    port = _free_port()
    width, height = parameters.size
    command = [
        *(sys.executable, "-m", "rerun_cli", "--headless", "--bind", "127.0.0.1", "--port", str(port)),
        *("--window-size", f"{width}x{height}", "--memory-limit", parameters.memory_limit, "--hide-welcome-screen"),
    ]
    viewer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=output, start_new_session=True)
    try:
        _wait_until_up(viewer, port, parameters.start_timeout, output)
        client = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        client.open(str(recording.resolve()))
        yield client
    finally:
        _stop(viewer)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def _wait_until_up(viewer: subprocess.Popen[bytes], port: int, timeout: float, output: TextIO) -> None:
    deadline = time.monotonic() + timeout
    while time.monotonic() < deadline:
        if viewer.poll() is not None:
            raise ScreenshotError(
                f"the viewer stopped with code {viewer.returncode}; it needs a Vulkan driver "
                f"(Debian: apt-get install {NEEDED_PACKAGES}): {_tail(output)}"
            )
        try:
            socket.create_connection(("127.0.0.1", port), timeout=0.5).close()
            return
        except OSError:
            time.sleep(0.1)
    raise ScreenshotError(f"the viewer did not start within {timeout} s")


def _stop(viewer: subprocess.Popen[bytes]) -> None:
    """End the viewer with the launcher that started it: both are in a session of their own."""
    if viewer.poll() is None:
        os.killpg(viewer.pid, signal.SIGTERM)
    try:
        viewer.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        os.killpg(viewer.pid, signal.SIGKILL)
        viewer.wait()


def _tail(output: TextIO) -> str:
    """What the viewer printed when it failed: from its panic on, else the end."""
    output.seek(0)
    text = output.read()
    panic = text.find("panicked at")
    return text[panic : panic + 300].strip() if panic >= 0 else text[-300:].strip()
