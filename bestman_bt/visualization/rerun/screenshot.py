"""Pictures of a recording without a screen: the viewer runs headless and is asked for a screenshot.

Needs a Vulkan driver; without a GPU Debian's ``libvulkan1 mesa-vulkan-drivers`` (lavapipe) do.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from bestman_bt.visualization.errors import ScreenshotError, ViewerError
from bestman_bt.visualization.rerun import entities
from bestman_bt.visualization.rerun.viewer import Display, Viewer, ViewerParameters

if TYPE_CHECKING:
    from rerun.experimental import ViewerClient

NEEDED_PACKAGES = "libvulkan1 mesa-vulkan-drivers"


@dataclass(frozen=True)
class ScreenshotParameters:
    """``size``: pixels; ``start_timeout``, ``settle``: seconds to wait for the viewer and for what it draws.

    ``attempts``: how often a viewer is asked that is too busy to answer in time.
    """

    size: tuple[int, int] = (1920, 1080)
    start_timeout: float = 30.0
    settle: float = 4.0
    attempts: int = 4
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
    with tempfile.TemporaryFile("w+") as output, _headless_viewer(chosen, output) as viewer:
        from rerun.experimental import ViewerClient

        try:
            client = ViewerClient.connect(viewer.address)
            client.open(str(recording.resolve()))
            return [_take(client, stamp, chosen) for stamp in stamps]
        except (ConnectionError, TimeoutError, RuntimeError) as error:
            raise ScreenshotError(f"the viewer failed on {recording}: {error}; it said: {viewer.said()}") from error


def _take(client: ViewerClient, stamp: float, parameters: ScreenshotParameters) -> Screenshot:
    for left in reversed(range(parameters.attempts)):
        try:
            client.set_time(entities.SIM_TIME, duration=stamp, play_state="paused")
            time.sleep(parameters.settle)
            png = client.take_screenshot()
            views = client.get_state().views
            break
        except TimeoutError:
            if left == 0:
                raise
    reports = tuple(f"{view.name}: {report.summary}" for view in views for report in view.reports)
    return Screenshot(png, reports)


@contextmanager
def _headless_viewer(parameters: ScreenshotParameters, output: TextIO) -> Iterator[Viewer]:
    asked = ViewerParameters(
        Display.NONE,
        size=parameters.size,
        memory_limit=parameters.memory_limit,
        start_timeout=parameters.start_timeout,
    )
    try:
        viewer = Viewer(asked, (), output)
    except ViewerError as error:
        needed = f"it needs a Vulkan driver (Debian: apt-get install {NEEDED_PACKAGES})"
        raise ScreenshotError(f"{error}; {needed}") from error
    try:
        yield viewer
    finally:
        viewer.stop()
