"""Maps as ROS keeps them: a YAML file with resolution and origin, and an image, as nav2's map_server reads them.

http://wiki.ros.org/map_server and nav2_map_server's map_io: modes trinary, scale and raw; PGM, PNG and other images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from bestman_bt.messages import OccupancyGrid
from bestman_bt.messages.occupancy_grid import FREE, OCCUPIED, UNKNOWN

MODES = ("trinary", "scale", "raw")
FREE_THRESHOLD, OCCUPIED_THRESHOLD = 0.196, 0.65
"""Below and above which share of black a cell is free and occupied, as ROS 1 has them.

nav2's own 0.25 takes the grey that it writes for unknown cells, 205, for free ones.
"""
WHITE, GREY, BLACK = 254, 205, 0
"""What ROS writes for free, unknown and occupied."""


class MapFileError(ValueError):
    """A map that cannot be read or written: names the file, the field and what would be accepted."""


def read_map(path: str | Path) -> OccupancyGrid:
    """The map of a YAML file; its image is looked for beside it. Raises MapFileError."""
    path = Path(path)
    data = _document(path)
    mode = data.get("mode", "trinary")
    if mode not in MODES:
        raise _wrong(path, "mode", mode, f"one of {', '.join(MODES)}")
    negate = data.get("negate", 0)
    if negate not in (0, 1):
        raise _wrong(path, "negate", negate, "0 or 1")
    resolution = _number(path, data, "resolution")
    if resolution <= 0.0:
        raise _wrong(path, "resolution", resolution, "metres per pixel, more than 0")
    free = _number(path, data, "free_thresh", FREE_THRESHOLD)
    occupied = _number(path, data, "occupied_thresh", OCCUPIED_THRESHOLD)
    if not 0.0 <= free < occupied <= 1.0:
        raise _wrong(path, "free_thresh", free, f"0 to 1 and less than occupied_thresh, {occupied:g}")
    origin = _origin(path, data)
    image = data.get("image")
    if not isinstance(image, str) or not image:
        raise _wrong(path, "image", image, "the name of an image file")
    grey, opaque = _pixels(path, path.parent / image)
    values = _values(grey, opaque, mode, bool(negate), free, occupied)
    return OccupancyGrid(values[::-1], resolution, origin)  # an image's first row is the map's last


def write_map(grid: OccupancyGrid, path: str | Path, mode: str = "trinary") -> Path:
    """Write NAME.yaml and its image beside it; returns the path of the YAML file.

    ``path``: with or without ``.yaml``. The image is NAME.pgm, in mode ``scale`` NAME.png, which can say "unknown"
    beside all shades. Folders are made. Raises MapFileError.
    """
    path = Path(path)
    path = path if path.suffix == ".yaml" else path.with_name(path.name + ".yaml")
    if mode not in MODES:
        raise _wrong(path, "mode", mode, f"one of {', '.join(MODES)}")
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
        image = Image.fromarray(np.where(known, data, 255).astype(np.uint8))
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


def _values(
    grey: NDArray[np.uint8], opaque: NDArray[np.bool_], mode: str, negate: bool, free: float, occupied: float
) -> NDArray[np.int8]:
    if mode == "raw":
        return np.where(grey <= OCCUPIED, grey, UNKNOWN).astype(np.int8)
    black = grey / 255.0 if negate else 1.0 - grey / 255.0
    if mode == "trinary":
        between: NDArray[Any] = np.full(grey.shape, UNKNOWN)
    else:
        between = np.rint((black - free) / (occupied - free) * 100.0)
        between = np.where(opaque, between.clip(FREE, OCCUPIED), UNKNOWN)
    sure = np.ones_like(opaque) if mode == "trinary" else opaque
    values = np.where(sure & (black > occupied), OCCUPIED, np.where(sure & (black < free), FREE, between))
    return values.astype(np.int8)


def _pixels(path: Path, image_path: Path) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Grey levels, and where the image is opaque."""
    try:
        with Image.open(image_path) as image:
            image.load()
            rgba = np.asarray(image.convert("RGBA"))
    except FileNotFoundError as error:
        raise _wrong(path, "image", image_path.name, f"an image file; there is no {image_path}") from error
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        message = f"{path}: image: {image_path.name} is no image that can be read, or is cut off: {error}"
        raise MapFileError(message) from error
    grey = np.rint(rgba[..., :3].mean(axis=-1)).astype(np.uint8)
    return grey, rgba[..., 3] == 255


def _document(path: Path) -> Mapping[str, Any]:
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise MapFileError(f"{path}: there is no such file; expected a map's YAML") from error
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise MapFileError(f"{path}: cannot be read as a map's YAML: {str(error).splitlines()[0]}") from error
    if not isinstance(data, Mapping):
        raise MapFileError(f"{path}: should hold image, resolution and origin, got {type(data).__name__}")
    return data


def _origin(path: Path, data: Mapping[str, Any]) -> NDArray[np.float64]:
    origin = data.get("origin")
    if not isinstance(origin, list | tuple) or len(origin) not in (2, 3) or not all(_is_finite(v) for v in origin):
        raise _wrong(path, "origin", origin, "[x, y, yaw] in metres and radians")
    if len(origin) == 3 and abs(float(origin[2])) > 1e-9:
        raise _wrong(path, "origin", origin, "a yaw of 0: maps that are turned are not read; turn the image instead")
    return np.array([float(origin[0]), float(origin[1])])


def _number(path: Path, data: Mapping[str, Any], field: str, default: float | None = None) -> float:
    value = data.get(field, default)
    if not _is_finite(value):
        raise _wrong(path, field, value, "a finite number")
    return float(value)


def _is_finite(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _wrong(path: Path, field: str, value: Any, wanted: str) -> MapFileError:
    return MapFileError(f"{path}: {field}: got {value!r}, expected {wanted}")
