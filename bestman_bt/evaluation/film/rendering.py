"""Renders a finished run: stills and a film, by the simulator's fast renderer or by Blender."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bestman_bt.evaluation.film.film import caption, captioned, require_film_writer, write_film, write_still
from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.film.painted import paint_job
from bestman_bt.evaluation.film.shot import best_frame, plan_shot
from bestman_bt.evaluation.film.stage import Stage
from bestman_bt.visualization import RobotSnapshot
from bestman_bt.visualization.blender import blender_python, paint
from hal.simulation import Viewpoint

LARGEST_STILL = 600_000
LARGEST_FILM = 6_000_000


@dataclass(frozen=True)
class RenderOptions:
    """``at``: seconds of the run that get a still; none: the moment in which most is seen. ``film``: whether an mp4 is
    made too. ``blender``: whether Blender paints; ``samples``: its light paths per pixel. ``size``: pixels, even.
    """

    at: tuple[float, ...] = ()
    film: bool = False
    blender: bool = False
    size: tuple[int, int] = (960, 720)
    samples: int = 32


def render(run: FilmedRun, out: Path, options: RenderOptions, tell: Callable[[str], None]) -> list[Path]:
    """Write ``still-<seconds>.jpg`` and, where asked, ``film.mp4`` into ``out``; returns what was written.

    Raises FilmError or BlenderError, before anything is drawn where something is missing.
    """
    late = [time for time in options.at if not 0.0 <= time <= run.motion.duration]
    if late:
        raise FilmError(f"the run has no second {late[0]:g}: it goes from 0 to {run.motion.duration:.2f}")
    if any(not 64 <= pixels <= 4096 or pixels % 2 for pixels in options.size):
        raise FilmError(f"the size should be two even numbers from 64 to 4096, but is {options.size}")
    if options.film:
        require_film_writer()
    python = blender_python() if options.blender else None
    with _written_into(out):
        out.mkdir(parents=True, exist_ok=True)
    with Stage(run) as stage:
        tell("choosing where the camera stands")
        shot = plan_shot(run, stage)
        stills = options.at or (shot.times[best_frame(run, shot, stage)],)
        times = [*stills, *(shot.times if options.film else ())]
        frames = [(run.motion.at(time), shot.view_at(time)) for time in times]
        if python is not None:
            pictures = _painted(run, frames, options, python, tell)
        else:
            pictures = _photographed(stage, frames, options, tell)
    written = []
    with _written_into(out):
        for time, picture in zip(stills, pictures, strict=False):
            written.append(out / f"still-{time:06.2f}.jpg")
            write_still(picture, written[-1], LARGEST_STILL)
        if options.film:
            written.append(out / "film.mp4")
            told = [caption(run, shot, time) for time in shot.times]
            film = [captioned(picture, text) for picture, text in zip(pictures[len(stills) :], told, strict=True)]
            write_film(film, written[-1], LARGEST_FILM)
    return written


@contextmanager
def _written_into(out: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise FilmError(f"{out} cannot be written: {error.strerror or error}") from error


Frame = tuple[RobotSnapshot, Viewpoint]


def _photographed(
    stage: Stage, frames: Sequence[Frame], options: RenderOptions, tell: Callable[[str], None]
) -> list[NDArray[np.uint8]]:
    """By the simulator's own renderer: a few seconds a picture of 960×720."""
    pictures = []
    for snapshot, view in frames:
        stage.set(snapshot)
        pictures.append(stage.picture(view, *options.size, oversampling=2))
        tell(f"picture {len(pictures)} of {len(frames)}")
    return pictures


def _painted(
    run: FilmedRun, frames: Sequence[Frame], options: RenderOptions, python: Path, tell: Callable[[str], None]
) -> list[NDArray[np.uint8]]:
    """By Blender: many seconds a picture."""
    with TemporaryDirectory() as name:
        files = [Path(name) / f"{number:05d}.png" for number in range(len(frames))]
        job = paint_job(run, frames, files, options.size, options.samples)
        done: list[Path] = []

        def on_frame(file: Path) -> None:
            done.append(file)
            tell(f"picture {len(done)} of {len(frames)}")

        paint(job, python, on_frame)
        return [np.asarray(Image.open(file).convert("RGB")) for file in files]
