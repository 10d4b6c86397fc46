"""Datasets that grow: by episodes, by whole datasets, after a killed process."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet as parquet
import pytest

from bestman_bt.manipulation.policy.training.dataset_folder import ROWS_PER_FILE, DatasetError, DatasetFolder
from bestman_bt.manipulation.policy.training.dataset_video import VideoFile, pictures
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat, DatasetWriter

FORMAT = DatasetFormat(
    10, {"action": ("a", "b")}, ("node",), {"head": (32, 48)}, "two_joints", {"action": ("rad", "m")}
)


def written(folder: Path, episodes: list[tuple[int, str]], frames: DatasetFormat = FORMAT) -> DatasetFolder:
    """Return a dataset of ``episodes``: length and task of each; the first number of its frames is the length."""
    writer = DatasetWriter(folder, frames)
    for length, task in episodes:
        for step in range(length):
            picture = np.full((32, 48, 3), 10 * length, dtype=np.uint8)
            values = {"action": [length, step], "goal": [0.0], "node": "x"}
            writer.add_frame(values, dict.fromkeys(frames.cameras, picture))
        writer.end_episode(task, seed=length)
    return DatasetFolder.read(folder)


def contents(dataset: DatasetFolder) -> dict[str, Any]:
    paths = [path for path in dataset.path.rglob("*") if path.is_file()]
    return {
        str(path.relative_to(dataset.path)): parquet.read_table(path).to_pydict()
        if path.suffix == ".parquet"
        else path.read_bytes()
        for path in paths
    }


def test_appended_datasets_are_the_one_that_would_have_been_written_at_once(tmp_path: Path) -> None:
    first, second = [(4, "pick"), (3, "place")], [(5, "place"), (2, "push")]
    whole = written(tmp_path / "whole", [*first, *second])
    grown = written(tmp_path / "first", first)
    grown.append(written(tmp_path / "second", second))
    assert contents(grown) == contents(whole)
    again = DatasetFolder.read(grown.path)
    assert again.data(2)["action"][4] == [5.0, 4.0]
    assert [set(again.data(episode)["task_index"]) for episode in range(4)] == [{0}, {1}, {1}, {2}]
    path, start, end = again.video(3, "observation.images.head")
    shown = list(pictures(path, start, end))
    assert len(shown) == 2
    assert shown[0].mean() == pytest.approx(20, abs=4)


def test_a_foreign_dataset_with_several_episodes_in_a_file_is_appended(tmp_path: Path) -> None:
    frames = replace(FORMAT, cameras={})
    source = written(tmp_path / "source", [(2, "a"), (3, "b")], frames)
    tables = [parquet.read_table(source.path / f"data/chunk-000/file-00{number}.parquet") for number in (0, 1)]
    parquet.write_table(pyarrow.concat_tables(tables), source.path / "data/chunk-000/file-000.parquet")
    (source.path / "data/chunk-000/file-001.parquet").unlink()
    rows = source.path / "meta/episodes/chunk-000/file-000.parquet"
    described = parquet.read_table(rows).to_pylist()
    described[1]["data/file_index"] = 0
    parquet.write_table(pyarrow.Table.from_pylist(described), rows)
    target = written(tmp_path / "target", [(4, "b")], frames)
    target.append(DatasetFolder.read(source.path))
    assert [row["data/file_index"] for row in target.episodes] == [0, 1, 1]
    found = DatasetFolder.read(target.path)
    assert [found.data(episode)["action"][0][0] for episode in range(3)] == [4.0, 2.0, 3.0]
    assert [found.data(episode)["index"][0] for episode in range(3)] == [0, 4, 6]
    assert [found.data(episode)["task_index"][0] for episode in range(3)] == [0, 1, 0]


def test_pictures_of_an_episode_that_begins_within_a_video_are_its_own(tmp_path: Path) -> None:
    dataset = written(tmp_path / "set", [(7, "a")])
    path, start, end = dataset.video(0, "observation.images.head")
    whole = VideoFile(tmp_path / "whole.mp4", FORMAT.fps, FORMAT.cameras["head"])
    texture = np.random.default_rng(3).integers(0, 100, size=(32, 48, 1), dtype=np.uint8)
    for step in range(6):  # of one texture, because x264 begins anew where a picture is another one
        whole.add(np.repeat(texture + 20 * step, 3, axis=2))
    whole.close()
    assert len(list(pictures(path, start, end))) == 7
    shown = [picture.mean() - texture.mean() for picture in pictures(tmp_path / "whole.mp4", 0.3, 0.5)]
    assert shown == pytest.approx([60, 80], abs=4)


def test_all_differences_are_named(tmp_path: Path) -> None:
    here = written(tmp_path / "here", [(2, "a")])
    other = replace(
        FORMAT, fps=20, numbers={"action": ("a", "c"), "goal": ("x",)}, cameras={}, robot="one_joint", units={}
    )
    there = written(tmp_path / "there", [(2, "a")], other)
    before = contents(here)
    with pytest.raises(DatasetError) as refused:
        here.append(there)
    for words in (
        "fps is 20, not 10",
        "robot_type is 'one_joint', not 'two_joints'",
        "names of feature action is ['a', 'c'], not ['a', 'b']",
        "feature goal is additional",
        "feature observation.images.head is missing",
    ):
        assert words in str(refused.value)
    assert contents(here) == before


def test_rows_of_episodes_are_spread_over_files_of_which_only_the_last_is_written_again(tmp_path: Path) -> None:
    frames = replace(FORMAT, cameras={})
    grown = written(tmp_path / "set", [(1, "a")] * (ROWS_PER_FILE - 1), frames)
    more = written(tmp_path / "more", [(1, "b")] * 2, frames)
    first, second = (grown.path / f"meta/episodes/chunk-000/file-00{number}.parquet" for number in (0, 1))
    grown.append(more)
    closed = first.stat().st_mtime_ns
    grown.append(more)
    assert first.stat().st_mtime_ns == closed
    assert [parquet.read_metadata(path).num_rows for path in (first, second)] == [ROWS_PER_FILE, 3]
    assert DatasetFolder.read(grown.path).episodes == grown.episodes
    assert [row["meta/episodes/file_index"] for row in grown.episodes[-4:]] == [0, 1, 1, 1]


def test_an_episode_whose_row_is_written_counts_though_the_process_was_killed_before_the_rest(tmp_path: Path) -> None:
    frames = replace(FORMAT, cameras={})
    grown = written(tmp_path / "set", [(3, "a")], frames)
    info = (grown.path / "meta/info.json").read_bytes()
    grown.append(written(tmp_path / "more", [(2, "a")], frames))
    expected = contents(grown)
    (grown.path / "meta/info.json").write_bytes(info)  # as it was
    again = DatasetFolder.read(grown.path)
    assert (len(again.episodes), again.frames) == (2, 5)
    last = written(tmp_path / "last", [(1, "b")], frames)
    again.append(last)
    assert json.loads((grown.path / "meta/info.json").read_text())["total_episodes"] == 3
    assert contents(again).keys() > expected.keys()


@pytest.mark.parametrize(
    ("file", "text", "words"),
    [
        ("meta/info.json", "{", "is not a dataset of LeRobot, or damaged"),
        ("meta/info.json", '{"codebase_version": "v2.1"}', "has layout v2.1; only v3.0 is read"),
        ("meta/tasks.parquet", "", "is not a dataset of LeRobot, or damaged"),
    ],
)
def test_a_folder_that_is_no_dataset_is_refused(tmp_path: Path, file: str, text: str, words: str) -> None:
    dataset = written(tmp_path / "set", [(2, "a")], replace(FORMAT, cameras={}))
    (dataset.path / file).write_text(text)
    with pytest.raises(DatasetError) as refused:
        DatasetFolder.read(dataset.path)
    assert str(refused.value).count(str(dataset.path)) == 1 + (text == "")
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("file", "size", "words"),
    [
        ("data/chunk-000/file-000.parquet", 500, "cannot be read"),
        ("data/chunk-000/file-000.parquet", None, "cannot be read"),
        ("meta/episodes/chunk-000/file-000.parquet", None, "meta/episodes has 0 of the 2 episodes of info.json"),
    ],
)
def test_a_dataset_whose_files_are_missing_or_cut_is_refused(
    tmp_path: Path, file: str, size: int | None, words: str
) -> None:
    dataset = written(tmp_path / "set", [(2, "a"), (3, "a")], replace(FORMAT, cameras={}))
    damaged = dataset.path / file
    kept = damaged.read_bytes()[: size or 0]
    damaged.unlink()
    if size is not None:
        damaged.write_bytes(kept)
    with pytest.raises(DatasetError, match=words):
        DatasetFolder.read(dataset.path)


def test_a_dataset_with_few_rows_in_a_file_grows(tmp_path: Path) -> None:
    frames = replace(FORMAT, cameras={})
    source = written(tmp_path / "set", [(1, "a"), (2, "a"), (3, "a")], frames)
    first, second = (source.path / f"meta/episodes/chunk-000/file-00{number}.parquet" for number in (0, 1))
    rows = parquet.read_table(first).to_pylist()
    rows[2]["meta/episodes/file_index"] = 1
    parquet.write_table(pyarrow.Table.from_pylist(rows[:2]), first)
    parquet.write_table(pyarrow.Table.from_pylist(rows[2:]), second)
    DatasetFolder.read(source.path).append(written(tmp_path / "more", [(4, "b")], frames))
    grown = DatasetFolder.read(source.path).episodes
    assert [row["length"] for row in grown] == [1, 2, 3, 4]
    assert [row["meta/episodes/file_index"] for row in grown] == [0, 0, 1, 1]


@pytest.mark.parametrize("kept", [0, ROWS_PER_FILE - 1])
def test_a_dataset_of_which_a_file_is_damaged_leaves_the_other_one_as_it_was(tmp_path: Path, kept: int) -> None:
    frames = replace(FORMAT, cameras={})
    more = written(tmp_path / "more", [(1, "b"), (2, "c"), (3, "b")], frames)
    grown = DatasetFolder(tmp_path / "set", more.fps, more.robot, more.features)
    if kept:
        grown = written(tmp_path / "set", [(1, "a")] * kept, frames)
    before, episodes = contents(grown), list(grown.episodes)
    damaged = more.path / "data/chunk-000/file-002.parquet"
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[:100])
    with pytest.raises(DatasetError, match=r"file-002\.parquet cannot be read"):
        grown.append(more)
    assert contents(grown) == before
    assert (grown.episodes, grown.frames, list(grown.tasks)) == (episodes, kept, ["a"] if kept else [])
    damaged.write_bytes(whole)
    grown.append(more)
    again = DatasetFolder.read(grown.path)
    assert [row["length"] for row in again.episodes[kept:]] == [1, 2, 3]
    assert again.data(kept + 2)["index"] == [kept + 3, kept + 4, kept + 5]


class KilledError(BaseException):
    """Ends a test's process where a signal would."""


def test_a_process_killed_before_the_first_row_is_in_its_place_leaves_a_folder_for_a_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KilledError

    source = written(tmp_path / "source", [(2, "a")], replace(FORMAT, cameras={}))
    grown = DatasetFolder(tmp_path / "set", source.fps, source.robot, source.features)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rename", killed)
        with pytest.raises(KilledError):
            grown.append(source)
    assert not (grown.path / "meta").exists()
    again = DatasetFolder(grown.path, source.fps, source.robot, source.features)
    again.append(source)
    assert contents(DatasetFolder.read(again.path)) == contents(source)


@pytest.mark.parametrize(("file", "episodes"), [("tasks.parquet", 1), ("file-000.parquet", 1), ("info.json", 2)])
def test_a_process_killed_between_two_files_leaves_a_dataset_that_can_be_read_and_grow(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str, episodes: int
) -> None:
    frames = replace(FORMAT, cameras={})
    grown, more = (written(tmp_path / name, [(2, name)], frames) for name in ("set", "more"))
    replaced = Path.replace

    def killed(path: Path, target: Path) -> None:
        if path.name == file:
            raise KilledError
        replaced(path, target)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", killed)
        with pytest.raises(KilledError):
            grown.append(more)
    again = DatasetFolder.read(grown.path)
    assert len(again.episodes) == episodes
    again.append(written(tmp_path / "last", [(1, "last")], frames))
    assert json.loads((grown.path / "meta/info.json").read_text())["total_episodes"] == episodes + 1
    assert DatasetFolder.read(grown.path).data(episodes)["action"] == [[1.0, 0.0]]
    assert {path.name for path in grown.path.iterdir()} == {"data", "meta"}
