"""Maps in the format of ROS: a YAML file with resolution and origin, and an image, as read by nav2's map_server.

http://wiki.ros.org/map_server and nav2_map_server's map_io: modes trinary, scale and raw; PGM, PNG and other images.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import AfterValidator, Field

from bestman_bt.configuration.checked import salvage
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import ConfigurationError, UnreadError
from bestman_bt.configuration.quantity import Number, Share
from bestman_bt.errors import InputError
from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.grids import FREE, OCCUPIED, UNKNOWN

MODES = ("trinary", "scale", "raw")
FREE_THRESHOLD, OCCUPIED_THRESHOLD = 0.196, 0.65
"""Occupancy below and above which a cell is free and occupied, as in ROS 1.

Nav2's own 0.25 reads the grey that it writes for unknown cells, 205, as free.
"""
WHITE, GREY, BLACK = 254, 205, 0
"""Grey values that ROS writes for free, unknown and occupied cells."""
MOST_CELLS = 64_000_000
"""Largest number of cells of a map: 400 m by 400 m at 5 cm."""
_EIGHT_BITS = ("1", "L", "LA", "P", "RGB", "RGBA")
"""Pillow's modes of images whose shades are 0 to 255."""


class MapFileError(InputError, ValueError):
    """Raised if a map cannot be read or written; the message gives the file, the field and what is accepted."""


def _unturned(origin: tuple[float, ...]) -> tuple[float, ...]:
    if len(origin) not in (2, 3):
        raise ValueError("should be [x, y, yaw] in metres and radians")
    if len(origin) == 3 and abs(origin[2]) > 1e-9:
        raise ValueError("should have a yaw of 0: rotated maps are not supported; rotate the image instead")
    return origin


@dataclass(frozen=True)
class _MapFile:
    """The YAML of a map: resolution in metres per pixel, the place of the image's lower left corner in metres."""

    image: Annotated[str, Field(min_length=1)]
    resolution: Annotated[Number, Field(ge=1e-4, le=100.0)]
    origin: Annotated[tuple[Annotated[Number, Field(ge=-1e7, le=1e7)], ...], AfterValidator(_unturned)]
    mode: Literal["trinary", "scale", "raw"] = "trinary"
    negate: Literal[0, 1, False, True] = 0
    free_thresh: Share = FREE_THRESHOLD
    occupied_thresh: Share = OCCUPIED_THRESHOLD


def read_map(path: str | Path) -> OccupancyGrid:
    """Return the map of a YAML file with its image. Raises MapFileError listing every fault."""
    path = Path(path)
    if not path.exists():
        raise MapFileError(f"{path}: there is no such file; expected a map's YAML")
    try:
        document = read_document(path)
        file, problems = salvage(document, _MapFile)
    except ConfigurationError as error:
        raise MapFileError(str(error)) from error
    lines = [str(problem) for problem in problems]
    if file.free_thresh >= file.occupied_thresh:
        free, occupied = f"{file.free_thresh:g}", f"{file.occupied_thresh:g}"
        if "free_thresh" in document.data:
            wrong = _wrong(document, "free_thresh", f"should be less than occupied_thresh, {occupied}, got {free}")
        else:
            wrong = _wrong(document, "occupied_thresh", f"should be more than free_thresh, {free}, got {occupied}")
        lines.append(str(wrong))
    try:
        grey, opaque = _pixels(document, path.parent / file.image)
    except MapFileError as error:
        lines.append(str(error))
    except UnreadError:
        pass  # its fault is told
    if lines:
        raise MapFileError("\n".join(lines))
    values = _values_of_shades(file)[grey]
    if file.mode == "scale":
        values[~opaque] = UNKNOWN
    return OccupancyGrid(values[::-1], file.resolution, np.array(file.origin[:2]))  # an image's first row is the last


def write_map(grid: OccupancyGrid, path: str | Path, mode: str = "trinary") -> Path:
    """Write NAME.yaml and its image; returns the path of the YAML file.

    ``path``: with or without ``.yaml``. The image is NAME.pgm, or NAME.png in mode ``scale``, which can represent
    "unknown" beside all shades. Folders are created. Raises MapFileError.
    """
    path = Path(path)
    path = path if path.suffix == ".yaml" else path.with_name(path.name + ".yaml")
    if mode not in MODES:
        raise MapFileError(f"{path}: mode: got {mode!r}, expected one of {', '.join(MODES)}")
    if grid.data.size == 0:
        raise MapFileError(f"{path}: the map is empty; nothing was written")
    data = grid.data[::-1]
    image_path = path.with_suffix(".png" if mode == "scale" else ".pgm")
    known = (data >= FREE) & (data <= OCCUPIED)
    if mode == "trinary":
        shares = data / 100.0
        grey = np.full(data.shape, GREY, dtype=np.uint8)
        grey[known & (shares < FREE_THRESHOLD)] = WHITE
        grey[known & (shares > OCCUPIED_THRESHOLD)] = BLACK
        image = Image.fromarray(grey)
    elif mode == "scale":
        share = FREE_THRESHOLD + data / 100.0 * (OCCUPIED_THRESHOLD - FREE_THRESHOLD)
        grey = np.where(known, np.rint(255.0 * (1.0 - share)), 0.0).astype(np.uint8)
        image = Image.fromarray(np.dstack([grey, np.where(known, 255, 0).astype(np.uint8)]), mode="LA")
    else:
        image = Image.fromarray(np.where(known, data, -1).astype(np.uint8))
    facts = {
        "image": image_path.name,
        "mode": mode,
        "resolution": float(grid.resolution),
        "origin": [float(grid.origin[0]), float(grid.origin[1]), 0.0],
        "negate": 0,
        "occupied_thresh": OCCUPIED_THRESHOLD,
        "free_thresh": FREE_THRESHOLD,
    }
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        image.save(image_path)
        path.write_text(yaml.safe_dump(facts, sort_keys=False), encoding="utf-8")
    except OSError as error:
        raise MapFileError(f"{path}: cannot be written: {error.strerror or error}") from error
    return path


def _values_of_shades(file: _MapFile) -> NDArray[np.int8]:
    """Return the meaning of each of the 256 shades of an opaque cell."""
    shades = np.arange(256)
    if file.mode == "raw":
        return np.where(shades <= OCCUPIED, shades, UNKNOWN).astype(np.int8)
    black = shades / 255.0 if file.negate else 1.0 - shades / 255.0
    if file.mode == "trinary":
        between = np.full(shades.shape, float(UNKNOWN))
    else:
        span = file.occupied_thresh - file.free_thresh
        between = np.rint((black - file.free_thresh) / span * 100.0).clip(FREE, OCCUPIED)
    values = np.where(black > file.occupied_thresh, OCCUPIED, np.where(black < file.free_thresh, FREE, between))
    return values.astype(np.int8)


def _pixels(document: Document, image_path: Path) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Return grey levels, the mean of the colours as in nav2, and where the image is opaque."""
    name = document.data["image"]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # a limit of our own follows
            with Image.open(image_path) as image:
                if image.width * image.height > MOST_CELLS:
                    size = f"{image.width} × {image.height} pixels"
                    raise _wrong(document, "image", f"{name} has {size}; up to {MOST_CELLS:,} are read")
                if image.mode not in _EIGHT_BITS:
                    words = (
                        f"should have shades of 8 bits, 0 to 255, as ROS writes; {name} has more (mode {image.mode})"
                    )
                    raise _wrong(document, "image", words)
                pixels = np.asarray(image.convert("LA" if image.mode in ("1", "L", "LA") else "RGBA"))
    except FileNotFoundError as error:
        raise _wrong(document, "image", f"should be an image file, got {name!r}; there is no {image_path}") from error
    except Image.DecompressionBombError as error:
        raise _wrong(document, "image", f"{name} is too large; up to {MOST_CELLS:,} pixels are read") from error
    except MapFileError:
        raise
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise _wrong(document, "image", f"{name} is not a readable image, or is truncated: {error}") from error
    colours = pixels.shape[-1] - 1
    grey = pixels[..., 0]
    if colours > 1:
        grey = ((pixels[..., :colours].sum(axis=-1, dtype=np.uint16) + 1) // 3).astype(np.uint8)
    return grey, pixels[..., -1] == 255


def _wrong(document: Document, field: str, message: str) -> MapFileError:
    return MapFileError(str(document.problem((field,), message)))
