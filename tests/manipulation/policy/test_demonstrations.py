"""Recorded demonstrations, read back with pyarrow and OpenCV as LeRobot's loader reads them."""

from __future__ import annotations

import errno
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow.parquet as parquet
import pytest

from bestman_bt.manipulation.policy.base import Observation
from bestman_bt.manipulation.policy.errors import PolicyObservationError
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetError
from bestman_bt.manipulation.policy.training.demonstrations import DemonstrationFormat, DemonstrationRecorder
from bestman_bt.messages import Pose

FORMAT = DemonstrationFormat(10, ("a", "b"), gripper=True, goal_size=3, cameras={"head": (48, 64)}, robot="two_joints")
LENGTHS, TASKS = (6, 4, 5), ("reach", "pick", "reach")


def frame(episode: int, step: int) -> Observation:
    image = np.zeros((48, 64, 3), dtype=np.uint8)
    image[:, :, episode] = 200
    return Observation(np.array([episode, step / 10]), Pose(), np.arange(3.0), 0.04, {"head": image})


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("demonstrations") / "set"
    recorder = DemonstrationRecorder(folder, FORMAT)
    for episode, (length, task) in enumerate(zip(LENGTHS, TASKS, strict=True)):
        for step in range(length):
            recorder.add(frame(episode, step), [episode, step / 10 + 0.1], 0.08)
        assert recorder.end_episode(task) == episode
    return folder


def test_info_reports_what_there_is_and_where(dataset: Path) -> None:
    info = json.loads((dataset / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"], info["fps"]) == (3, 15, 2, 10)
    assert info["features"]["action"] == {"dtype": "float32", "shape": [3], "names": ["a", "b", "gripper_width"]}
    assert info["features"]["observation.images.head"]["shape"] == [48, 64, 3]


def test_each_episode_is_found_through_its_row_and_holds_its_frames(dataset: Path) -> None:
    info = json.loads((dataset / "meta/info.json").read_text())
    episodes = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    for index, row in enumerate(episodes):
        assert (row["episode_index"], row["length"], row["tasks"]) == (index, LENGTHS[index], [TASKS[index]])
        place = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
        table = parquet.read_table(dataset / info["data_path"].format(**place)).to_pydict()
        assert table["index"] == list(range(row["dataset_from_index"], row["dataset_to_index"]))
        steps = np.arange(LENGTHS[index])
        np.testing.assert_allclose(table["timestamp"], steps / 10, atol=1e-6)
        expected = np.column_stack([np.full(len(steps), index), steps / 10, np.full(len(steps), 0.04)])
        np.testing.assert_allclose(table["observation.state"], expected, atol=1e-6)
        np.testing.assert_allclose(np.array(table["action"])[:, 1], steps / 10 + 0.1, atol=1e-6)
        assert set(table["task_index"]) == {0 if TASKS[index] == "reach" else 1}


def test_each_video_has_a_picture_per_frame_in_the_right_colours(dataset: Path) -> None:
    for index, length in enumerate(LENGTHS):
        video = cv2.VideoCapture(str(dataset / f"videos/observation.images.head/chunk-000/file-{index:03d}.mp4"))
        pictures = []
        while (read := video.read())[0]:
            pictures.append(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
        assert len(pictures) == length
        assert int(pictures[-1].mean(axis=(0, 1)).argmax()) == index
        assert pictures[-1][..., index].mean() == pytest.approx(200, abs=12)


def test_tasks_are_indexed_by_their_words(dataset: Path) -> None:
    table = parquet.read_table(dataset / "meta/tasks.parquet")
    assert table.to_pydict() == {"task_index": [0, 1], "task": ["reach", "pick"]}
    assert json.loads(table.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_statistics_are_those_of_all_frames(dataset: Path) -> None:
    stats = json.loads((dataset / "meta/stats.json").read_text())
    first = np.repeat([0.0, 1.0, 2.0], LENGTHS)
    assert stats["action"]["mean"][0] == pytest.approx(first.mean())
    assert stats["action"]["std"][0] == pytest.approx(first.std())
    assert stats["action"]["count"] == [15]
    np.testing.assert_allclose(
        np.ravel(stats["observation.images.head"]["mean"]), np.array(LENGTHS) / 15 * 200 / 255, atol=1e-6
    )


def test_a_discarded_episode_leaves_nothing(tmp_path: Path) -> None:
    recorder = DemonstrationRecorder(tmp_path / "set", FORMAT)
    recorder.add(frame(0, 0), [0, 0], 0.08)
    recorder.discard()
    with pytest.raises(DatasetError, match="at least one frame"):
        recorder.end_episode("reach")
    assert not (tmp_path / "set").exists()


def test_a_discarded_episode_leaves_what_others_have_put_beside_it(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    recorder = DemonstrationRecorder(tmp_path / "set", FORMAT)
    recorder.add(frame(0, 0), [0, 0], 0.08)
    recorder.discard()
    assert (tmp_path / "set").is_dir()
    recorder.add(frame(0, 0), [0, 0], 0.08)
    (tmp_path / "set" / "notes.txt").write_text("mine")
    recorder.discard()
    assert [path.name for path in (tmp_path / "set").rglob("*")] == ["notes.txt"]


@pytest.mark.parametrize("file", ["data", "meta.new"])
def test_a_full_disk_is_what_an_episode_reports_that_is_discarded_then(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, file: str
) -> None:
    recorder = DemonstrationRecorder(tmp_path / "set", FORMAT)
    recorder.add(frame(0, 0), [0, 0], 0.08)
    write_table = parquet.write_table

    def full(table: Any, path: Path) -> None:
        if file in Path(path).parts:
            raise OSError(errno.ENOSPC, "No space left on device")
        write_table(table, path)

    monkeypatch.setattr(parquet, "write_table", full)
    with pytest.raises(OSError, match="No space left"):
        recorder.end_episode("reach")
    recorder.discard()


def test_a_folder_that_is_in_use_is_not_written_to(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(DatasetError, match="not empty"):
        DemonstrationRecorder(tmp_path, FORMAT)
    with pytest.raises(DatasetError, match="cannot be a dataset's folder: Not a directory"):
        DemonstrationRecorder(tmp_path / "mine.txt", FORMAT)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize("action", [[0.0], [0.0, np.nan], [0.0, 0.0, 0.0]])
def test_a_frame_that_does_not_fit_is_refused(tmp_path: Path, action: list[float]) -> None:
    with pytest.raises(PolicyObservationError, match="action should be 3 finite numbers"):
        DemonstrationRecorder(tmp_path, FORMAT).add(frame(0, 0), action, 0.08)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"fps": 0}, "fps should be a whole number above 0, got 0"),
        ({"fps": float("nan")}, "fps should be"),
        ({"joint_names": ()}, "at least one joint"),
        ({"cameras": {"head": (-2, 4)}}, "an even height and width above 0"),
        ({"cameras": {"../../head": (4, 4)}}, "letters, digits"),
    ],
)
def test_a_format_that_no_dataset_can_have_is_refused(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(DatasetError, match=told):
        replace(FORMAT, **wrong)
