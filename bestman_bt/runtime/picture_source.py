"""Pictures that skills take as events: all of them for who subscribes, and in run folders the last before a failure."""

from __future__ import annotations

import base64
import io
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from behaviours.context import SkillContext
from bestman_bt.control.rgbd import RGBDView
from bestman_bt.monitor.event_stream import Tell
from bestman_bt.records.events import ImageEvent, Topic

FOLDER = "pictures"
MOST_PICTURES = 50
"""Pictures that a run folder gets."""
WIDEST_LIVE, WIDEST_KEPT = 480, 320
"""Pixels that a picture is wide at most."""
QUALITY = 80


class PictureSource:
    """Listens to the robot's cameras: no picture is taken for it. ``folder``: of the run, if there is one."""

    def __init__(self, skills: SkillContext, folder: Path | None) -> None:
        self._folder = folder
        self._tell: Tell | None = None
        self._last: tuple[str, RGBDView] | None = None
        self._untold: dict[str, RGBDView] = {}
        self._kept: dict[tuple[str, float], str] = {}
        for camera in skills.cameras:
            camera.subscribe(partial(self._seen, camera.name))

    def begin(self, tell: Tell) -> None:
        """Somebody keeps or watches from now on."""
        self._tell = tell

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Tell what was taken in this tick."""
        if "images" in wanted and self._tell is not None:
            for camera, view in self._untold.items():
                self._tell(partial(_live_events, time, camera, view.image.rgb))
        self._untold.clear()

    def failed(self, time: float, node: str) -> None:
        """Keep what was seen last, from whichever camera."""
        if self._folder is None or self._tell is None or self._last is None:
            return
        camera, view = self._last
        taken = (camera, view.stamp)
        file = self._kept.get(taken)
        if file is None:
            if len(self._kept) >= MOST_PICTURES:
                return
            file = self._kept[taken] = f"{FOLDER}/{len(self._kept) + 1:02}-{camera}.jpg"
        self._tell(partial(_kept_events, time, camera, view.image.rgb, self._folder, file, node))

    def _seen(self, camera: str, view: RGBDView) -> None:
        self._last = (camera, view)
        self._untold[camera] = view


def _live_events(time: float, camera: str, rgb: NDArray[np.uint8]) -> tuple[ImageEvent]:
    width, height, jpeg = _jpeg(rgb, WIDEST_LIVE)
    return (ImageEvent(time, camera, width, height, jpeg=base64.b64encode(jpeg).decode()),)


def _kept_events(
    time: float, camera: str, rgb: NDArray[np.uint8], folder: Path, file: str, node: str
) -> tuple[ImageEvent]:
    width, height, jpeg = _jpeg(rgb, WIDEST_KEPT)
    path = folder / file
    if not path.exists():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(jpeg)
    return (ImageEvent(time, camera, width, height, file=file, node=node),)


def _jpeg(rgb: NDArray[np.uint8], widest: int) -> tuple[int, int, bytes]:
    """Width, height and file of (H, W, 3) uint8, made smaller where it is wider than ``widest``."""
    image = Image.fromarray(rgb)
    image.thumbnail((widest, rgb.shape[0]))
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return image.width, image.height, file.getvalue()
