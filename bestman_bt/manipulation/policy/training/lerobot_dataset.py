"""Writes episodes as datasets in LeRobot's layout: parquet for numbers, mp4 for cameras.

One data file and one video per camera and episode, which the layout allows.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.extras import require_extra
from bestman_bt.manipulation.policy.training.dataset_folder import (
    DATA,
    VIDEOS,
    DatasetError,
    DatasetFolder,
    import_pyarrow,
)
from bestman_bt.manipulation.policy.training.dataset_statistics import PictureStatistics, number_statistics
from bestman_bt.manipulation.policy.training.dataset_video import CODEC, VideoFile

IMAGES = "observation.images."
SUBTASK, LANGUAGE = "subtask", "language_persistent"
_CAMERA = re.compile(r"[A-Za-z0-9_-]+")
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


@dataclass(frozen=True)
class DatasetFormat:
    """The content of each frame.

    ``fps``: frames per second. ``numbers``: feature → the names of its entries. ``texts``: features that are a text.
    ``cameras``: name → (H, W) pixels, even. ``units``: feature → the units of its entries, if known. ``subtasks``:
    whether each frame has a text ``subtask`` that describes the robot's activity; the texts of an episode are kept as
    LeRobot's ``language_persistent``. Raises DatasetError.
    """

    fps: int
    numbers: Mapping[str, tuple[str, ...]]
    texts: tuple[str, ...] = ()
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    robot: str = ""
    units: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    subtasks: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.fps, bool) or not isinstance(self.fps, int) or self.fps <= 0:
            raise DatasetError(f"fps should be a whole number above 0, got {self.fps!r}")
        for name, (height, width) in self.cameras.items():
            if not _CAMERA.fullmatch(name):
                raise DatasetError(f"a camera's name becomes a folder's: letters, digits, _ and -, got {name!r}")
            if min(height, width) <= 0 or height % 2 or width % 2:
                raise DatasetError(f"camera {name!r} should have an even height and width above 0, got {height, width}")

    def videos(self) -> dict[str, tuple[int, int]]:
        """Return the video features and their (H, W)."""
        return {f"{IMAGES}{name}": size for name, size in self.cameras.items()}

    def features(self) -> dict[str, Any]:
        """Return the entry ``features`` of ``info.json``."""
        features: dict[str, Any] = {
            name: {"dtype": "float32", "shape": [len(entries)], "names": list(entries)}
            for name, entries in self.numbers.items()
        }
        for name, units in self.units.items():
            features[name]["units"] = list(units)
        features |= {name: {"dtype": "string", "shape": [1], "names": None} for name in self.texts}
        if self.subtasks:
            features[LANGUAGE] = {"dtype": "language", "shape": [1], "names": None}
        for name, (height, width) in self.videos().items():
            features[name] = {
                "dtype": "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": CODEC,
                    "video.pix_fmt": "yuv420p",
                    "video.is_depth_map": False,
                    "video.fps": self.fps,
                    "video.channels": 3,
                    "has_audio": False,
                },
            }
        for name in _COUNTERS:
            features[name] = {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
        return features


class DatasetWriter:
    """Writes episodes: ``add_frame`` for each frame, then ``end_episode``; ``discard`` drops the frames since.

    Raises DatasetError if the folder is not usable, MissingExtraError without pyarrow or, with cameras, PyAV.
    """

    def __init__(self, folder: str | Path, frames: DatasetFormat) -> None:
        self.folder, self.frames = Path(folder), frames
        import_pyarrow()
        if frames.cameras:
            require_extra("recording pictures", "video")
        try:
            self._new = not self.folder.exists()
            used = not self._new and any(self.folder.iterdir())
        except OSError as error:
            raise DatasetError(f"{self.folder} cannot be a dataset's folder: {error.strerror}") from error
        if used:
            raise DatasetError(f"{self.folder} is not empty; a dataset needs an empty folder")
        self._dataset = DatasetFolder(self.folder, frames.fps, frames.robot, frames.features())
        self._rows: list[dict[str, Any]] = []
        self._videos: dict[str, VideoFile] = {}
        self._pictures: dict[str, PictureStatistics] = {}

    def add_frame(self, values: Mapping[str, Any], pictures: Mapping[str, NDArray[np.uint8]]) -> None:
        """Add a frame: feature → numbers, float32, or text, and camera → (H, W, 3) RGB.

        Raises DatasetError for a frame that does not fit.
        """
        row: dict[str, Any] = {}
        for name, entries in self.frames.numbers.items():
            row[name] = np.asarray(values[name], dtype=np.float32)
            if row[name].shape != (len(entries),) or not np.isfinite(row[name]).all():
                raise DatasetError(f"{name} should be {len(entries)} finite numbers but is {row[name]}")
        for camera, (height, width) in self.frames.cameras.items():
            picture = pictures.get(camera)
            if picture is None or picture.shape != (height, width, 3):
                found = None if picture is None else picture.shape
                raise DatasetError(f"camera {camera!r} should give {(height, width, 3)} but gives {found}")
        for name, size in self.frames.videos().items():
            if name not in self._videos:
                self._videos[name] = VideoFile(self._video_path(name), self.frames.fps, size)
                self._pictures[name] = PictureStatistics()
            picture = pictures[name.removeprefix(IMAGES)]
            self._videos[name].add(picture)
            self._pictures[name].add(picture)
        texts = (*self.frames.texts, SUBTASK) if self.frames.subtasks else self.frames.texts
        self._rows.append(row | {name: str(values[name]) for name in texts})

    def discard(self) -> None:
        """Discard the frames of the episode being recorded."""
        for video in self._videos.values():
            video.close()
            video.path.unlink(missing_ok=True)
            if not self._dataset.episodes:
                made = [folder for folder in video.path.parents if self.folder in folder.parents]
                with suppress(OSError):  # something else is in it
                    for folder in [*made, *[self.folder] * self._new]:
                        folder.rmdir()
        self._rows, self._videos, self._pictures = [], {}, {}

    def end_episode(self, task: str, **about: Any) -> int:
        """Write the episode with ``task``, its description; returns its index.

        ``about``: further columns of its row in ``meta/episodes``.
        """
        arrow, parquet = import_pyarrow()
        if not self._rows:
            raise DatasetError("an episode should have at least one frame")
        dataset, length = self._dataset, len(self._rows)
        index = len(dataset.episodes)
        tasks = list(dict.fromkeys([*dataset.tasks, task]))
        texts = {name: [row[name] for row in self._rows] for name in self.frames.texts}
        columns: dict[str, Any] = {name: np.stack([row[name] for row in self._rows]) for name in self.frames.numbers}
        steps = np.arange(length)
        columns |= {
            "timestamp": (steps / self.frames.fps).astype(np.float32),
            "frame_index": steps,
            "episode_index": np.full(length, index),
            "index": steps + dataset.frames,
            "task_index": np.full(length, tasks.index(task)),
        }
        episode: dict[str, Any] = {
            "episode_index": index,
            "tasks": [task],
            "length": length,
            "dataset_from_index": dataset.frames,
            "dataset_to_index": dataset.frames + length,
        }
        for name, video in self._videos.items():
            video.close()
            place = dataset.next_file(f"{VIDEOS}/{name}")
            episode |= {f"{VIDEOS}/{name}/{key}": value for key, value in place.items()}
            episode |= {f"{VIDEOS}/{name}/from_timestamp": 0.0}
            episode |= {f"{VIDEOS}/{name}/to_timestamp": length / self.frames.fps}
        place = dataset.next_file(DATA)
        episode |= {f"{DATA}/{key}": value for key, value in place.items()}
        path = dataset.file(DATA, place)
        path.parent.mkdir(parents=True, exist_ok=True)
        table = {name: _column(arrow, values) for name, values in columns.items()} | texts
        if self.frames.subtasks:
            spans = _spans([row[SUBTASK] for row in self._rows], columns["timestamp"])
            table[LANGUAGE] = arrow.array([spans] * length, _language_type(arrow))
        parquet.write_table(arrow.table(table), path)
        statistics = {name: number_statistics(values) for name, values in columns.items()}
        statistics |= {name: one.to_dict() for name, one in self._pictures.items()}
        for name, found in statistics.items():
            episode |= {f"stats/{name}/{key}": value for key, value in found.items()}
        self._rows, self._videos, self._pictures = [], {}, {}  # if its row gets written, its files have to stay
        dataset.add([episode | about], [task])
        return index

    def _video_path(self, name: str) -> Path:
        kind = f"{VIDEOS}/{name}"
        return self._dataset.file(kind, self._dataset.next_file(kind))


def _spans(texts: Sequence[str], times: NDArray[np.float32]) -> list[dict[str, Any]]:
    """Return a row of ``language_persistent`` for each frame that begins another subtask; it lasts until the next."""
    begins = [index for index, text in enumerate(texts) if text and (index == 0 or text != texts[index - 1])]
    return [
        {"role": "assistant", "content": texts[index], "style": "subtask", "timestamp": float(times[index])}
        for index in begins
    ]


def _language_type(arrow: Any) -> Any:
    """Return the type of ``language_persistent`` in LeRobot 0.6.1: all rows of the episode in each frame."""
    fields = {
        "role": arrow.string(),
        "content": arrow.string(),
        "style": arrow.string(),
        "timestamp": arrow.float32(),
        "camera": arrow.string(),
        "tool_calls": arrow.list_(arrow.string()),
    }
    return arrow.list_(arrow.struct(list(fields.items())))


def _column(arrow: Any, values: NDArray[Any]) -> Any:
    if values.ndim == 1:
        return arrow.array(values)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(values.reshape(-1)), values.shape[1])
