"""Datasets in LeRobot's layout, version 3.0: parquet for numbers, mp4 for cameras.

Cadene et al., "LeRobot", 2024. One data file and one video per camera and episode, which the layout allows; everything
under ``meta`` is rewritten after each episode, so that what has been recorded can always be read.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.errors import PolicyError

FILES_PER_FOLDER = 1000
THINNED = 4
"""Every so many pixels of a picture count in its statistics."""
_NUMBERED = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_CAMERA = re.compile(r"[A-Za-z0-9_-]+")
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


class DatasetError(PolicyError):
    """A dataset that cannot be written: the folder is in use, a frame does not fit, a video cannot be made."""

    code = "dataset"


class FeatureStatistics:
    """Statistics of one feature of ``size`` numbers; for images of the channels over all pixels, 0 to 1."""

    def __init__(self, size: int) -> None:
        self.low, self.high = np.full(size, np.inf), np.full(size, -np.inf)
        self._sum, self._squares = np.zeros(size), np.zeros(size)
        self._samples = 0
        self.count = 0

    @classmethod
    def of(cls, document: Mapping[str, Any], samples: int) -> FeatureStatistics:
        """Return the statistics of an entry of ``stats.json``, of ``samples`` numbers in each frame."""
        low, high, mean, std = (np.ravel(document[name]).astype(float) for name in ("min", "max", "mean", "std"))
        found = cls(len(low))
        found.count = int(document["count"][0])
        found._samples = found.count * samples
        found.low, found.high = low, high
        found._sum, found._squares = mean * found._samples, (std**2 + mean**2) * found._samples
        return found

    def add(self, values: ArrayLike) -> None:
        """Add (N, size) numbers of N frames."""
        array = np.asarray(values, dtype=float).reshape(-1, len(self.low))
        self._include(array, len(array))

    def add_picture(self, picture: NDArray[np.uint8]) -> None:
        """Add one (H, W, 3) image, sampled at each ``THINNED``th pixel in both directions."""
        self._include(picture[::THINNED, ::THINNED].reshape(-1, 3) / 255.0, 1)

    def to_dict(self, picture: bool = False) -> dict[str, Any]:
        """Return the entry of LeRobot's ``stats.json``; for images each value is (3, 1, 1)."""
        mean = self._sum / self._samples
        std = np.sqrt(np.maximum(self._squares / self._samples - mean**2, 0.0))
        found = {"min": self.low, "max": self.high, "mean": mean, "std": std}
        shape = (3, 1, 1) if picture else (-1,)
        return {name: value.reshape(shape).tolist() for name, value in found.items()} | {"count": [self.count]}

    def _include(self, rows: NDArray[np.float64], frames: int) -> None:
        self.low, self.high = np.minimum(self.low, rows.min(axis=0)), np.maximum(self.high, rows.max(axis=0))
        self._sum += rows.sum(axis=0)
        self._squares += (rows**2).sum(axis=0)
        self._samples += len(rows)
        self.count += frames


@dataclass(frozen=True)
class DatasetFormat:
    """The content of each frame.

    ``fps``: frames per second. ``numbers``: feature → the names of its entries. ``texts``: features that are a text.
    ``cameras``: name → (H, W) pixels, even. Raises DatasetError.
    """

    fps: int
    numbers: Mapping[str, tuple[str, ...]]
    texts: tuple[str, ...] = ()
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    robot: str = ""

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
        return {f"observation.images.{name}": size for name, size in self.cameras.items()}

    def features(self) -> dict[str, Any]:
        """Return the entry ``features`` of ``info.json``."""
        features: dict[str, Any] = {
            name: {"dtype": "float32", "shape": [len(entries)], "names": list(entries)}
            for name, entries in self.numbers.items()
        }
        features |= {name: {"dtype": "string", "shape": [1], "names": None} for name in self.texts}
        for name, (height, width) in self.videos().items():
            features[name] = {
                "dtype": "video",
                "shape": [height, width, 3],
                "names": ["height", "width", "channels"],
                "info": {
                    "video.height": height,
                    "video.width": width,
                    "video.codec": "mpeg4",
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

    ``resume``: whether the folder may hold a dataset of the same format, which then grows. Raises DatasetError if the
    folder is not usable, MissingExtraError without pyarrow.
    """

    def __init__(self, folder: str | Path, frames: DatasetFormat, resume: bool = False) -> None:
        self.folder, self.frames = Path(folder), frames
        self.episodes: list[dict[str, Any]] = []
        self._rows: list[dict[str, Any]] = []
        self._pictures: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in frames.videos()}
        self._tasks: dict[str, int] = {}
        self._totals: dict[str, FeatureStatistics] = {}
        self._count = 0
        _, parquet = _pyarrow()
        try:
            used = self.folder.exists() and any(self.folder.iterdir())
        except OSError as error:
            raise DatasetError(f"{self.folder} cannot be a dataset's folder: {error.strerror}") from error
        if used and not resume:
            raise DatasetError(f"{self.folder} is not empty; a dataset needs a folder of its own")
        if used:
            self._resume(parquet)

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
        for camera in self.frames.cameras:
            self._pictures[f"observation.images.{camera}"].append(pictures[camera].copy())
        self._rows.append(row | {name: str(values[name]) for name in self.frames.texts})

    def discard(self) -> None:
        """Forget the frames of the episode that is being recorded."""
        self._rows = []
        self._pictures = {name: [] for name in self._pictures}

    def end_episode(self, task: str, **about: Any) -> int:
        """Write the episode with ``task``, its description; returns its index.

        ``about``: further columns of its row in ``meta/episodes``.
        """
        arrow, parquet = _pyarrow()
        if not self._rows:
            raise DatasetError("an episode should have at least one frame")
        index, length = len(self.episodes), len(self._rows)
        task_index = self._tasks.setdefault(task, len(self._tasks))
        texts = {name: [row[name] for row in self._rows] for name in self.frames.texts}
        columns: dict[str, Any] = {name: np.stack([row[name] for row in self._rows]) for name in self.frames.numbers}
        steps = np.arange(length)
        columns |= {
            "timestamp": (steps / self.frames.fps).astype(np.float32),
            "frame_index": steps,
            "episode_index": np.full(length, index),
            "index": steps + self._count,
            "task_index": np.full(length, task_index),
        }
        place = {"chunk_index": index // FILES_PER_FOLDER, "file_index": index % FILES_PER_FOLDER}
        episode: dict[str, Any] = {
            "episode_index": index,
            "tasks": [task],
            "length": length,
            "dataset_from_index": self._count,
            "dataset_to_index": self._count + length,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        } | {f"data/{key}": value for key, value in place.items()}
        for name, pictures in self._pictures.items():
            self._write_video(self.folder / "videos" / name / f"{_NUMBERED.format(**place)}.mp4", name, pictures)
            episode |= {f"videos/{name}/{key}": value for key, value in place.items()}
            episode |= {f"videos/{name}/from_timestamp": 0.0, f"videos/{name}/to_timestamp": length / self.frames.fps}
        path = self.folder / "data" / f"{_NUMBERED.format(**place)}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        table = {name: _column(arrow, values) for name, values in columns.items()} | texts
        parquet.write_table(arrow.table(table), path)
        for name, found in self._statistics(columns).items():
            episode |= {f"stats/{name}/{key}": value for key, value in found.items()}
        self.episodes.append(episode | about)
        self._count += length
        self._write_meta(arrow, parquet)
        self.discard()
        return index

    def _resume(self, parquet: Any) -> None:
        meta = self.folder / "meta"
        try:
            info = json.loads((meta / "info.json").read_text(encoding="utf-8"))
            stats = json.loads((meta / "stats.json").read_text(encoding="utf-8"))
            self.episodes = parquet.read_table(meta / "episodes/chunk-000/file-000.parquet").to_pylist()
        except (OSError, ValueError) as error:
            raise DatasetError(f"{self.folder} is neither empty nor a dataset: {error}") from error
        for key, wanted in (
            ("fps", self.frames.fps),
            ("robot_type", self.frames.robot),
            ("features", self.frames.features()),
        ):
            if info.get(key) != wanted:
                raise DatasetError(
                    f"{self.folder} holds a dataset of another {key}: {_difference(info.get(key), wanted)}"
                )
        self._count = int(info["total_frames"])
        for episode in self.episodes:
            self._tasks.setdefault(episode["tasks"][0], len(self._tasks))
        samples = {
            name: math.prod(math.ceil(side / THINNED) for side in size) for name, size in self.frames.videos().items()
        }
        self._totals = {name: FeatureStatistics.of(entry, samples.get(name, 1)) for name, entry in stats.items()}

    def _statistics(self, columns: Mapping[str, NDArray[Any]]) -> dict[str, dict[str, Any]]:
        """Return the statistics of this episode, and add them to the totals."""
        found = {}
        for name, values in columns.items():
            size = values.shape[1] if values.ndim == 2 else 1
            for statistics in (one := FeatureStatistics(size), self._totals.setdefault(name, FeatureStatistics(size))):
                statistics.add(values)
            found[name] = one.to_dict()
        for name, pictures in self._pictures.items():
            one, total = FeatureStatistics(3), self._totals.setdefault(name, FeatureStatistics(3))
            for picture in pictures:
                one.add_picture(picture)
                total.add_picture(picture)
            found[name] = one.to_dict(picture=True)
        return found

    def _write_video(self, path: Path, name: str, pictures: list[NDArray[np.uint8]]) -> None:
        height, width = self.frames.videos()[name]
        path.parent.mkdir(parents=True, exist_ok=True)
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(path), codec, float(self.frames.fps), (width, height))
        if not writer.isOpened():
            raise DatasetError(f"cannot write the video {path}")
        for picture in pictures:
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        writer.release()

    def _write_meta(self, arrow: Any, parquet: Any) -> None:
        meta = self.folder / "meta"
        (meta / "episodes" / "chunk-000").mkdir(parents=True, exist_ok=True)
        parquet.write_table(_tasks_table(arrow, self._tasks), meta / "tasks.parquet")
        parquet.write_table(arrow.Table.from_pylist(self.episodes), meta / "episodes/chunk-000/file-000.parquet")
        videos = self.frames.videos()
        stats = {name: statistics.to_dict(picture=name in videos) for name, statistics in self._totals.items()}
        (meta / "stats.json").write_text(json.dumps(stats, indent=4), encoding="utf-8")
        (meta / "info.json").write_text(json.dumps(self._info(), indent=4), encoding="utf-8")

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": "v3.0",
            "robot_type": self.frames.robot,
            "total_episodes": len(self.episodes),
            "total_frames": self._count,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_FOLDER,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self.frames.fps,
            "splits": {"train": f"0:{len(self.episodes)}"},
            "data_path": f"data/{_NUMBERED}.parquet",
            "video_path": f"videos/{{video_key}}/{_NUMBERED}.mp4" if self.frames.cameras else None,
            "features": self.frames.features(),
        }


def _difference(found: Any, wanted: Any) -> str:
    if not (isinstance(found, dict) and isinstance(wanted, dict)):
        return f"{found!r}, not {wanted!r}"
    return ", ".join(sorted(name for name in {*found, *wanted} if found.get(name) != wanted.get(name)))


def _column(arrow: Any, values: NDArray[Any]) -> Any:
    if values.ndim == 1:
        return arrow.array(values)
    return arrow.FixedSizeListArray.from_arrays(arrow.array(values.reshape(-1)), values.shape[1])


def _tasks_table(arrow: Any, tasks: Mapping[str, int]) -> Any:
    """Return the tasks with their text as the index of a pandas table, which is how LeRobot looks them up."""
    table = arrow.table({"task_index": arrow.array(list(tasks.values()), arrow.int64()), "task": list(tasks)})
    described = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, kind, numpy_kind in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError(f"recording needs pyarrow: {install_command('policy')}") from error
    return pyarrow, pyarrow.parquet
