"""Folders in LeRobot's dataset layout, version 3.0: their content, and the addition of episodes.

Cadene et al., "LeRobot", 2024. An episode exists once its row in ``meta/episodes`` does; all other files under ``meta``
are derived from the rows. Files are replaced as a whole, so a killed process leaves a dataset that can be read and
grow.
"""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.errors import PolicyError
from bestman_bt.manipulation.policy.training.dataset_statistics import combined, number_statistics

FILES_PER_FOLDER = 1000
ROWS_PER_FILE = 100
"""Number of episodes whose rows share a file of ``meta/episodes``, which is rewritten with each of them."""
NUMBERED = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA, VIDEOS = "data", "videos"
FAILURES = "failures"
"""The folder beside ``data`` that may hold a dataset of failed episodes; LeRobot does not look there."""
COUNTERS = ("episode_index", "index", "task_index")
_ROW_PLACE = ("meta/episodes/chunk_index", "meta/episodes/file_index")
_STATS = re.compile(r"stats/(.+)/(\w+)")


class DatasetError(PolicyError):
    """A dataset that cannot be read or written: the folder is in use, a frame does not fit, formats differ."""

    code = "dataset"


class DatasetFolder:
    """A dataset that grows by episodes whose files are in place, or by whole datasets.

    ``fps``, ``robot`` and ``features`` (those of ``info.json``) are the same for all its episodes.
    """

    def __init__(self, path: Path, fps: int, robot: str, features: Mapping[str, Any]) -> None:
        """Describe an empty dataset; nothing is written before the first episode."""
        self.path, self.fps, self.robot, self.features = path, fps, robot, dict(features)
        self.episodes: list[dict[str, Any]] = []
        """The rows of ``meta/episodes``, without statistics."""
        self.tasks: dict[str, int] = {}
        self.frames = 0
        self._columns: set[str] = set()
        self._last_rows: list[dict[str, Any]] = []
        self._files: Counter[str] = Counter()
        self._totals: dict[str, dict[str, Any]] = {}

    @classmethod
    def read(cls, path: Path) -> DatasetFolder:
        """Return the dataset in a folder. Raises DatasetError without one or if files are missing or damaged,
        MissingExtraError without pyarrow.
        """
        _, parquet = import_pyarrow()
        try:
            info = json.loads((path / "meta/info.json").read_text(encoding="utf-8"))
            version = str(info["codebase_version"])
            if not version.startswith("v3."):
                raise DatasetError(f"{path} has layout {version}; only v3.0 is read: LeRobot converts older ones")
            found = cls(path, info["fps"], info["robot_type"], info["features"])
            tasks = parquet.read_table(path / "meta/tasks.parquet").to_pydict()
            (texts,) = (values for name, values in tasks.items() if name != "task_index")
            found.tasks = dict(sorted(zip(texts, tasks["task_index"], strict=True), key=lambda task: task[1]))
            for row in found.rows():
                found._take(row)
            found._check_files(info["total_episodes"])
        except DatasetError:
            raise
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise DatasetError(f"{path} is not a dataset of LeRobot, or damaged: {error}") from error
        return found

    @property
    def videos(self) -> list[str]:
        """Return the features that are videos."""
        return [name for name, feature in self.features.items() if feature["dtype"] == "video"]

    def rows(self) -> Iterator[dict[str, Any]]:
        """Yield the rows of ``meta/episodes``, with statistics."""
        _, parquet = import_pyarrow()
        for path in sorted((self.path / "meta/episodes").glob("*/*.parquet")):
            yield from parquet.read_table(path).to_pylist()

    def data(self, episode: int) -> dict[str, list[Any]]:
        """Return the columns of an episode's frames. Raises DatasetError if the file cannot be read."""
        row = self.episodes[episode]
        table = self._read_data(row["data/chunk_index"], row["data/file_index"])
        begin = table["episode_index"].to_numpy().searchsorted(episode)
        frames: dict[str, list[Any]] = table.slice(begin, row["length"]).to_pydict()
        return frames

    def video(self, episode: int, feature: str) -> tuple[Path, float, float]:
        """Return the file of an episode's video and its start and end in that file, seconds."""
        row, key = self.episodes[episode], f"{VIDEOS}/{feature}"
        place = {name: row[f"{key}/{name}"] for name in ("chunk_index", "file_index")}
        return self.file(key, place), row[f"{key}/from_timestamp"], row[f"{key}/to_timestamp"]

    def differences(self, other: DatasetFolder) -> list[str]:
        """Return the reasons why the two datasets cannot be merged."""
        found = [
            f"{name} is {theirs!r}, not {mine!r}"
            for name, mine, theirs in (("fps", self.fps, other.fps), ("robot_type", self.robot, other.robot))
            if mine != theirs
        ]
        for name in dict.fromkeys([*self.features, *other.features]):
            mine, theirs = (one.features.get(name) for one in (self, other))
            if mine is None or theirs is None:
                found.append(f"feature {name} is {'missing' if theirs is None else 'additional'}")
            elif mine != theirs:
                fields = [key for key in {**mine, **theirs} if mine.get(key) != theirs.get(key)]
                found += [
                    f"{key} of feature {name} is {theirs.get(key)!r}, not {mine.get(key)!r}" for key in sorted(fields)
                ]
        if self.episodes and other.episodes and (columns := self._columns ^ other._columns):
            found.append(f"its episodes are described by other columns: {', '.join(sorted(columns))}")
        return found

    def next_file(self, kind: str) -> dict[str, int]:
        """Return the number of the next file of ``data`` or of a ``videos/FEATURE``."""
        return _place(self._files[kind])

    def file(self, kind: str, place: Mapping[str, int]) -> Path:
        """Return the path of a numbered file of ``data`` or of a ``videos/FEATURE``."""
        return self.path / kind / (NUMBERED.format(**place) + (".parquet" if kind == DATA else ".mp4"))

    def add(self, rows: Iterable[dict[str, Any]], tasks: Iterable[str]) -> None:
        """Add episodes, whose files are in place, by their rows; ``tasks``: the task texts, referenced by index.

        After an exception, this object and the dataset are as before, without the files of the rows added so far.
        """
        meta, staged, count = self.path / "meta", self.path / "meta.new", len(self.episodes)
        before = {name: copy(value) for name, value in vars(self).items() if name != "episodes"}
        shutil.rmtree(staged, ignore_errors=True)  # left by a process that was killed
        try:
            self._stage(staged, rows, tasks)
        except BaseException:
            for kind, files in self._files.items():
                for number in range(before["_files"][kind], files):
                    self.file(kind, _place(number)).unlink(missing_ok=True)
            vars(self).update(before)
            del self.episodes[count:]
            shutil.rmtree(staged, ignore_errors=True)
            raise
        if not meta.exists():
            staged.rename(meta)
            return
        rows_files = sorted((staged / "episodes").glob("*/*"))
        for path in (staged / "tasks.parquet", *rows_files, staged / "stats.json", staged / "info.json"):
            target = meta / path.relative_to(staged)
            target.parent.mkdir(parents=True, exist_ok=True)
            path.replace(target)
        shutil.rmtree(staged)

    def _stage(self, staged: Path, rows: Iterable[dict[str, Any]], tasks: Iterable[str]) -> None:
        """Write the files of ``meta`` that change into a new folder."""
        arrow, parquet = import_pyarrow()
        place: dict[str, int] = {}

        def write_last_rows() -> None:
            path = staged / "episodes" / f"{NUMBERED.format(**place)}.parquet"
            path.parent.mkdir(parents=True, exist_ok=True)
            parquet.write_table(arrow.Table.from_pylist(self._last_rows), path)

        staged.mkdir(parents=True)
        for row in rows:
            if place and place != self._next_place():
                write_last_rows()
            place = self._next_place()
            self._take({**row, **{f"meta/episodes/{key}": value for key, value in place.items()}})
        if place:
            write_last_rows()
        for task in tasks:
            self.tasks.setdefault(task, len(self.tasks))
        parquet.write_table(_tasks_table(arrow, self.tasks), staged / "tasks.parquet")
        for name, document in (("stats", self._totals), ("info", self._info())):
            (staged / f"{name}.json").write_text(json.dumps(document, indent=4), encoding="utf-8")

    def append(self, other: DatasetFolder) -> None:
        """Copy the episodes of another dataset, with unchanged videos. Raises DatasetError if the formats differ."""
        if problems := self.differences(other):
            raise DatasetError(f"{other.path} does not match {self.path}: {'; '.join(problems)}")
        tasks = dict.fromkeys([*self.tasks, *other.tasks])
        self.add(self._copies(other, np.array([list(tasks).index(task) for task in other.tasks])), tasks)

    def _copies(self, other: DatasetFolder, task_index: NDArray[np.int64]) -> Iterator[dict[str, Any]]:
        """Copy the files of another dataset and yield the rows that its episodes have here."""
        first, frames = len(self.episodes), self.frames
        copied: dict[tuple[str, int, int], dict[str, int]] = {}
        statistics: dict[int, dict[str, Any]] = {}
        for row in other.rows():
            moved = dict(row)
            for kind in (DATA, *(f"{VIDEOS}/{name}" for name in self.videos)):
                here = (kind, row[f"{kind}/chunk_index"], row[f"{kind}/file_index"])
                if here not in copied:
                    copied[here] = self.next_file(kind)
                    self._files[kind] += 1
                    target = self.file(kind, copied[here])
                    target.parent.mkdir(parents=True, exist_ok=True)
                    if kind == DATA:
                        statistics |= self._copy_data(other, here[1:], target, (first, frames, task_index))
                    else:
                        shutil.copyfile(other.file(kind, {"chunk_index": here[1], "file_index": here[2]}), target)
                moved |= {f"{kind}/{key}": value for key, value in copied[here].items()}
            moved["episode_index"] += first
            for key in ("dataset_from_index", "dataset_to_index"):
                moved[key] += frames
            recomputed = statistics.pop(moved["episode_index"])
            yield moved | {key: value for key, value in recomputed.items() if key in row}

    def _copy_data(
        self, other: DatasetFolder, place: tuple[int, int], target: Path, offsets: tuple[int, int, NDArray[np.int64]]
    ) -> dict[int, dict[str, Any]]:
        """Write a file of frames with the indices of this dataset; return the statistics of these by episode."""
        arrow, parquet = import_pyarrow()
        table, (first, frames, task_index) = other._read_data(*place), offsets
        columns = {name: table[name].to_numpy() for name in COUNTERS}
        columns["episode_index"] = columns["episode_index"] + first
        columns["index"] = columns["index"] + frames
        columns["task_index"] = task_index[columns["task_index"]]
        for name, values in columns.items():
            table = table.set_column(table.schema.get_field_index(name), name, arrow.array(values, arrow.int64()))
        parquet.write_table(table, target)
        found: dict[int, dict[str, Any]] = {}
        for episode in dict.fromkeys(columns["episode_index"].tolist()):
            of_episode = columns["episode_index"] == episode
            entries = found[episode] = {}
            for name, values in columns.items():
                one = number_statistics(values[of_episode])
                entries |= {f"stats/{name}/{key}": value for key, value in one.items()}
        return found

    def _read_data(self, chunk: int, file: int) -> Any:
        _, parquet = import_pyarrow()
        path = self.file(DATA, {"chunk_index": chunk, "file_index": file})
        try:
            return parquet.read_table(path)
        except (OSError, ValueError) as error:
            raise DatasetError(f"{path} cannot be read: {error}") from error

    def _check_files(self, total: int) -> None:
        """Raise DatasetError unless there are at least ``total`` episodes and the files that they name."""
        _, parquet = import_pyarrow()
        if (known := len(self.episodes)) < total:
            raise DatasetError(f"{self.path}: meta/episodes has {known} of the {total} episodes of info.json")
        for kind in (DATA, *(f"{VIDEOS}/{name}" for name in self.videos)):
            frames: Counter[tuple[int, int]] = Counter()
            for row in self.episodes:
                frames[row[f"{kind}/chunk_index"], row[f"{kind}/file_index"]] += row["length"]
            for (chunk, file), count in frames.items():
                path = self.file(kind, {"chunk_index": chunk, "file_index": file})
                try:
                    found = parquet.read_metadata(path).num_rows if kind == DATA else count * bool(path.stat().st_size)
                except (OSError, ValueError) as error:
                    raise DatasetError(f"{path} cannot be read: {error}") from error
                if found < count:
                    raise DatasetError(f"{path} is damaged: it has {found} of {count} frames")

    def _take(self, row: dict[str, Any]) -> None:
        if row["episode_index"] != len(self.episodes):
            raise DatasetError(f"{self.path}: episode {len(self.episodes)} is missing in meta/episodes")
        if self._last_rows and any(row[key] != self._last_rows[-1][key] for key in _ROW_PLACE):
            self._last_rows = []
        self._last_rows.append(row)
        self._columns = set(row)
        statistics: dict[str, dict[str, Any]] = {}
        for column, value in row.items():
            if found := _STATS.fullmatch(column):
                statistics.setdefault(found[1], {})[found[2]] = value
        for name, values in statistics.items():
            self._totals[name] = combined(self._totals.get(name), values)
        self.episodes.append({name: value for name, value in row.items() if not name.startswith("stats/")})
        self.frames += row["length"]
        for kind in (DATA, *(f"{VIDEOS}/{name}" for name in self.videos)):
            used = row[f"{kind}/chunk_index"] * FILES_PER_FOLDER + row[f"{kind}/file_index"]
            self._files[kind] = max(self._files[kind], used + 1)

    def _next_place(self) -> dict[str, int]:
        """Return the number of the file of ``meta/episodes`` that gets the next row."""
        if not self._last_rows:
            return _place(0)
        chunk, file = (self._last_rows[-1][key] for key in _ROW_PLACE)
        number = chunk * FILES_PER_FOLDER + file + (len(self._last_rows) >= ROWS_PER_FILE)
        return _place(number)

    def _info(self) -> dict[str, Any]:
        return {
            "codebase_version": "v3.0",
            "robot_type": self.robot,
            "total_episodes": len(self.episodes),
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": FILES_PER_FOLDER,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self.fps,
            "splits": {"train": f"0:{len(self.episodes)}"},
            "data_path": f"data/{NUMBERED}.parquet",
            "video_path": f"videos/{{video_key}}/{NUMBERED}.mp4" if self.videos else None,
            "features": self.features,
        }


def entry_names(feature: Mapping[str, Any]) -> list[str]:
    """Return the names of a feature's entries; empty without any.

    LeRobot keeps a list of them, a list per group, or their numbers by name.
    """
    names = feature.get("names") or []
    if not isinstance(names, Mapping):
        return list(names)
    if all(isinstance(place, int) for place in names.values()):
        return sorted(names, key=lambda name: names[name])
    return [name for group in names.values() for name in group]


def _place(number: int) -> dict[str, int]:
    return {"chunk_index": number // FILES_PER_FOLDER, "file_index": number % FILES_PER_FOLDER}


def _tasks_table(arrow: Any, tasks: Mapping[str, int]) -> Any:
    """Return the tasks with their text as the index of a pandas table, which is how LeRobot looks them up."""
    table = arrow.table({"task_index": arrow.array(list(tasks.values()), arrow.int64()), "task": list(tasks)})
    described = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy_kind, "metadata": None}
        for name, kind, numpy_kind in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {"index_columns": ["task"], "column_indexes": [], "columns": described, "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({"pandas": json.dumps(pandas)})


def import_pyarrow() -> tuple[Any, Any]:
    """Return pyarrow and its module parquet. Raises MissingExtraError."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError(f"datasets need pyarrow: {install_command('policy')}") from error
    return pyarrow, pyarrow.parquet
