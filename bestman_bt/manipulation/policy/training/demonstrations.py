"""Demonstrations on disk in LeRobot's dataset layout, version 3.0: parquet for numbers, mp4 for cameras.

Cadene et al., "LeRobot", 2024. One data file and one video per camera and episode, which the layout allows; everything
under ``meta`` is rewritten after each episode, so that what has been recorded can always be read.
"""

from __future__ import annotations

import json
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
from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import PolicyError, PolicyObservationError


@dataclass(frozen=True, eq=False)
class Demonstration:
    """One episode of N chunks: the observation before each, and the H actions after it.

    ``chunks``: (N, H, n) joint deltas, radians; (N, H, n + 1) with the gripper: +1 open, -1 closed.
    """

    observations: tuple[Observation, ...]
    chunks: NDArray[np.float64]


class FeatureStatistics:
    """Statistics of one feature of ``size`` numbers; for images of the channels over all pixels, 0 to 1."""

    def __init__(self, size: int) -> None:
        self.low, self.high = np.full(size, np.inf), np.full(size, -np.inf)
        self._sum, self._squares = np.zeros(size), np.zeros(size)
        self._samples = 0
        self.count = 0

    def add(self, values: ArrayLike) -> None:
        """Add (N, size) numbers of N frames."""
        array = np.asarray(values, dtype=float).reshape(-1, len(self.low))
        self._include(array, len(array))

    def add_picture(self, picture: NDArray[np.uint8]) -> None:
        """Add one (H, W, 3) image, sampled at each fourth pixel in both directions."""
        self._include(picture[::4, ::4].reshape(-1, 3) / 255.0, 1)

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


FILES_PER_FOLDER = 1000
_NUMBERED = "chunk-{chunk_index:03d}/file-{file_index:03d}"
_CAMERA = re.compile(r"[A-Za-z0-9_-]+")
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")


class DatasetError(PolicyError):
    """A dataset that cannot be written: the folder is in use, a frame does not fit, a video cannot be made."""

    code = "dataset"


@dataclass(frozen=True)
class DemonstrationFormat:
    """The content of each frame.

    ``fps``: frames per second. ``joint_names``: n; ``gripper``: whether the gripper's width, metres, follows in state
    and action. ``goal_size``: entries of ``observation.goal``; 0: none. ``cameras``: name → (H, W) pixels, even.
    """

    fps: int
    joint_names: tuple[str, ...]
    gripper: bool = False
    goal_size: int = 0
    cameras: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    robot: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.fps, bool) or not isinstance(self.fps, int) or self.fps <= 0:
            raise DatasetError(f"fps should be a whole number above 0, got {self.fps!r}")
        if not self.joint_names:
            raise DatasetError("joint_names should name at least one joint")
        if self.goal_size < 0:
            raise DatasetError(f"goal_size should be 0 or more, got {self.goal_size}")
        for name, (height, width) in self.cameras.items():
            if not _CAMERA.fullmatch(name):
                raise DatasetError(f"a camera's name becomes a folder's: letters, digits, _ and -, got {name!r}")
            if min(height, width) <= 0 or height % 2 or width % 2:
                raise DatasetError(f"camera {name!r} should have an even height and width above 0, got {height, width}")

    def numbers(self) -> dict[str, list[str]]:
        """Return the numeric features and the names of their entries."""
        joints = [*self.joint_names, *(["gripper_width"] if self.gripper else [])]
        goal = {"observation.goal": [f"goal_{i}" for i in range(self.goal_size)]} if self.goal_size else {}
        return {"observation.state": joints, **goal, "action": joints}

    def videos(self) -> dict[str, tuple[int, int]]:
        """Return the video features and their (H, W)."""
        return {f"observation.images.{name}": size for name, size in self.cameras.items()}


class DemonstrationRecorder:
    """Writes episodes: ``add`` each frame, then ``end_episode``; ``discard`` drops the frames since.

    Raises DatasetError if the folder is not usable, MissingExtraError without pyarrow, and later PolicyObservationError
    for a frame that does not fit.
    """

    def __init__(self, folder: str | Path, frames: DemonstrationFormat) -> None:
        self.folder = Path(folder)
        self.format = frames
        self._frames: list[dict[str, NDArray[np.float32]]] = []
        self._pictures: dict[str, list[NDArray[np.uint8]]] = {name: [] for name in frames.videos()}
        self._episodes: list[dict[str, Any]] = []
        self._tasks: dict[str, int] = {}
        self._totals: dict[str, FeatureStatistics] = {}
        self._count = 0
        _pyarrow()
        try:
            if self.folder.exists() and any(self.folder.iterdir()):
                raise DatasetError(f"{self.folder} is not empty; a dataset needs a folder of its own")
        except OSError as error:
            raise DatasetError(f"{self.folder} cannot be a dataset's folder: {error.strerror}") from error

    def add(self, observation: Observation, action: ArrayLike, gripper_command: float | None = None) -> None:
        """Add a frame: the observation, and the command: joint positions (n,) and the gripper's width."""
        widths = (observation.gripper_width, gripper_command) if self.format.gripper else ()
        if None in widths:
            raise PolicyObservationError("frames with a gripper need its width and its commanded width")
        given = np.array(widths, dtype=np.float32)
        joints = np.asarray(action, dtype=np.float32).reshape(-1)
        values = {
            "observation.state": np.append(observation.joint_positions, given[:1]).astype(np.float32),
            "observation.goal": observation.goal.astype(np.float32),
            "action": np.append(joints, given[1:]).astype(np.float32),
        }
        row = {}
        for name, entries in self.format.numbers().items():
            if values[name].shape != (len(entries),) or not np.isfinite(values[name]).all():
                raise PolicyObservationError(f"{name} should be {len(entries)} finite numbers but is {values[name]}")
            row[name] = values[name]
        for camera, (height, width) in self.format.cameras.items():
            picture = observation.images.get(camera)
            if picture is None or picture.shape != (height, width, 3):
                found = None if picture is None else picture.shape
                raise PolicyObservationError(f"camera {camera!r} should give {(height, width, 3)} but gives {found}")
        for camera in self.format.cameras:
            self._pictures[f"observation.images.{camera}"].append(observation.images[camera].copy())
        self._frames.append(row)

    def discard(self) -> None:
        """Forget the frames of the episode that is being recorded."""
        self._frames = []
        self._pictures = {name: [] for name in self._pictures}

    def end_episode(self, task: str) -> int:
        """Write the episode with ``task``, its description; returns its index."""
        arrow, parquet = _pyarrow()
        if not self._frames:
            raise DatasetError("an episode should have at least one frame")
        index, length = len(self._episodes), len(self._frames)
        task_index = self._tasks.setdefault(task, len(self._tasks))
        columns: dict[str, Any] = {name: np.stack([frame[name] for frame in self._frames]) for name in self._frames[0]}
        steps = np.arange(length)
        columns |= {
            "timestamp": (steps / self.format.fps).astype(np.float32),
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
            episode |= {f"videos/{name}/from_timestamp": 0.0, f"videos/{name}/to_timestamp": length / self.format.fps}
        path = self.folder / "data" / f"{_NUMBERED.format(**place)}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        parquet.write_table(arrow.table({name: _column(arrow, values) for name, values in columns.items()}), path)
        for name, found in self._statistics(columns).items():
            episode |= {f"stats/{name}/{key}": value for key, value in found.items()}
        self._episodes.append(episode)
        self._count += length
        self._write_meta(arrow, parquet)
        self.discard()
        return index

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
        height, width = self.format.videos()[name]
        path.parent.mkdir(parents=True, exist_ok=True)
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(path), codec, float(self.format.fps), (width, height))
        if not writer.isOpened():
            raise DatasetError(f"cannot write the video {path}")
        for picture in pictures:
            writer.write(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        writer.release()

    def _write_meta(self, arrow: Any, parquet: Any) -> None:
        meta = self.folder / "meta"
        (meta / "episodes" / "chunk-000").mkdir(parents=True, exist_ok=True)
        parquet.write_table(_tasks_table(arrow, self._tasks), meta / "tasks.parquet")
        parquet.write_table(arrow.Table.from_pylist(self._episodes), meta / "episodes/chunk-000/file-000.parquet")
        videos = self.format.videos()
        stats = {name: statistics.to_dict(picture=name in videos) for name, statistics in self._totals.items()}
        (meta / "stats.json").write_text(json.dumps(stats, indent=4), encoding="utf-8")
        (meta / "info.json").write_text(json.dumps(self._info(), indent=4), encoding="utf-8")

    def _info(self) -> dict[str, Any]:
        fps = self.format.fps
        features: dict[str, Any] = {
            name: {"dtype": "float32", "shape": [len(entries)], "names": entries}
            for name, entries in self.format.numbers().items()
        }
        for name, (height, width) in self.format.videos().items():
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
                    "video.fps": fps,
                    "video.channels": 3,
                    "has_audio": False,
                },
            }
        for name in _COUNTERS:
            features[name] = {"dtype": "float32" if name == "timestamp" else "int64", "shape": [1], "names": None}
        return {
            "codebase_version": "v3.0",
            "robot_type": self.format.robot,
            "total_episodes": len(self._episodes),
            "total_frames": self._count,
            "total_tasks": len(self._tasks),
            "chunks_size": FILES_PER_FOLDER,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": fps,
            "splits": {"train": f"0:{len(self._episodes)}"},
            "data_path": f"data/{_NUMBERED}.parquet",
            "video_path": f"videos/{{video_key}}/{_NUMBERED}.mp4" if self.format.cameras else None,
            "features": features,
        }


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
