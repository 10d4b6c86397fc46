"""Renders a finished run: stills and a film, by the simulator's fast renderer or by Blender."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bestman_bt.evaluation.film.film import caption, captioned, require_film_writer, write_film, write_still
from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.film.painted import paint_job
from bestman_bt.evaluation.film.shot import Shot, best_frame, plan_shot
from bestman_bt.evaluation.film.stage import Stage
from bestman_bt.visualization.blender import blender_python, paint

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
    with Stage(run) as stage:
        tell("choosing where the camera stands")
        shot = plan_shot(run, stage)
        stills = sorted({shot.nearest(time) for time in options.at}) or [best_frame(run, shot, stage)]
        wanted = list(range(len(shot.times))) if options.film else stills
        draw = _Painter(run, shot, options, python) if python is not None else _Photographer(shot, stage, options)
        pictures = draw.pictures(wanted, tell)
    out.mkdir(parents=True, exist_ok=True)
    written = []
    for index in stills:
        written.append(out / f"still-{shot.times[index]:06.2f}.jpg")
        write_still(pictures[index], written[-1], LARGEST_STILL)
    if options.film:
        written.append(out / "film.mp4")
        film = (captioned(pictures[index], caption(run, shot, index)) for index in wanted)
        write_film(film, written[-1], LARGEST_FILM)
    return written


Pictures = dict[int, NDArray[np.uint8]]


class _Photographer:
    """The simulator's own renderer: about a second a picture."""

    def __init__(self, shot: Shot, stage: Stage, options: RenderOptions) -> None:
        self._shot, self._stage, self._size = shot, stage, options.size

    def pictures(self, wanted: Sequence[int], tell: Callable[[str], None]) -> Pictures:
        """The frames with these numbers."""
        found: Pictures = {}
        for number, index in enumerate(wanted, 1):
            self._stage.set(self._shot.snapshots[index])
            found[index] = self._stage.picture(self._shot.view(index), *self._size, oversampling=2)
            tell(f"picture {number} of {len(wanted)}")
        return found


class _Painter:
    """Blender: many seconds a picture."""

    def __init__(self, run: FilmedRun, shot: Shot, options: RenderOptions, python: Path) -> None:
        self._run, self._shot, self._options, self._python = run, shot, options, python

    def pictures(self, wanted: Sequence[int], tell: Callable[[str], None]) -> Pictures:
        """The frames with these numbers."""
        with TemporaryDirectory() as name:
            files = {index: Path(name) / f"{index:05d}.png" for index in wanted}
            frames = [(self._shot.snapshots[index], self._shot.view(index)) for index in wanted]
            job = paint_job(self._run, frames, list(files.values()), self._options.size, self._options.samples)
            done: list[Path] = []

            def on_frame(file: Path) -> None:
                done.append(file)
                tell(f"picture {len(done)} of {len(wanted)}")

            paint(job, self._python, on_frame)
            return {index: np.asarray(Image.open(file).convert("RGB")) for index, file in files.items()}
