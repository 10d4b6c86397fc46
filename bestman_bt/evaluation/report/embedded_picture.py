"""Pictures of a run folder, made small and safe to be put into a page."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image, UnidentifiedImageError

from bestman_bt.errors import Error
from bestman_bt.evaluation.report.story import StoryPicture

MAX_FILE = 16_000_000
MAX_PIXELS = 30_000_000
WIDTH = 640
QUALITY = 78


class PictureError(Error):
    """A file is no picture that can be shown."""


def embedded_picture(folder: Path, name: str, caption: str) -> StoryPicture:
    """The picture ``name`` of a run folder; it is decoded and written anew, so that nothing else of the file gets out.

    Raises PictureError; also for a name that leads out of the folder.
    """
    path = folder / name
    try:
        if not path.resolve(strict=True).is_relative_to(folder.resolve()):
            raise PictureError(f"{name!r} leads out of the run folder")
        if not path.is_file() or path.stat().st_size > MAX_FILE:
            raise PictureError(f"{name!r} is no picture of at most {MAX_FILE} bytes")
        with Image.open(path, formats=("PNG", "JPEG")) as image:
            if image.width * image.height > MAX_PIXELS:
                raise PictureError(f"{name!r} has {image.width} × {image.height} pixels; that is too much")
            small = image.convert("RGB")
            small.thumbnail((WIDTH, WIDTH))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise PictureError(f"{name!r} is no picture: {error}") from error
    out = io.BytesIO()
    small.save(out, "JPEG", quality=QUALITY, optimize=True)
    return StoryPicture(caption, out.getvalue(), small.width, small.height)
