"""Films and stills from pictures: a line that tells what is going on, an mp4, a JPEG."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from bestman_bt.evaluation.film.filmed_run import FilmedRun, FilmError
from bestman_bt.evaluation.film.shot import RATE, Shot
from bestman_bt.extras import install_command

LARGEST_FILM = 1_500_000
LARGEST_STILL = 200_000


def caption(run: FilmedRun, shot: Shot, time: float) -> str:
    """What is going on at a second of the run."""
    return f"{run.config.name}   {time:5.1f} s   {shot.speed:.2g} x   {run.doing(time)}"


def captioned(picture: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """With a line of text at the lower edge."""
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image, "RGBA")
    draw.rectangle((0, image.height - 24, image.width, image.height), fill=(20, 24, 28, 170))
    draw.text((10, image.height - 20), text, font=ImageFont.load_default(14), fill=(255, 255, 255, 255))
    return np.asarray(image)


def write_still(picture: NDArray[np.uint8], path: Path, largest: int = LARGEST_STILL) -> None:
    """A JPEG of at most ``largest`` bytes, or as small as it gets."""
    image = Image.fromarray(picture)
    for quality in (92, 88, 80, 70, 60):
        image.save(path, quality=quality, optimize=True)
        if path.stat().st_size <= largest:
            return


def require_film_writer() -> None:
    """Raises FilmError where films cannot be written; to be asked before the pictures are made."""
    try:
        import av  # noqa: F401 - only whether it is there
    except ImportError as error:
        raise FilmError(f"films need PyAV: {install_command('gallery')}") from error


def write_film(pictures: Iterable[NDArray[np.uint8]], path: Path, largest: int = LARGEST_FILM) -> None:
    """An mp4 (H.264) of at most ``largest`` bytes, or as small as it gets; FilmError without its writer."""
    require_film_writer()
    import av

    frames = list(pictures)
    height, width = frames[0].shape[:2]
    for quality in (21, 25, 29, 33, 37):
        with av.open(str(path), "w", options={"movflags": "faststart"}) as out:
            stream = out.add_stream("libx264", rate=RATE, options={"crf": str(quality), "preset": "slow"})
            stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
            for frame in frames:
                out.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
            out.mux(stream.encode())
        if path.stat().st_size <= largest:
            return
