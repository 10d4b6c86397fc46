"""Datasets described, drawn and merged from the command line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from bestman_bt.manipulation.policy.training.dataset_folder import DatasetFolder
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat, DatasetWriter
from tests.cli.command_line import Answer

Command = Callable[..., Answer]


def write(folder: Path, seeds: range, fps: int = 10, camera: str = "head", task: str = "pick", **about: str) -> None:
    names, units = ("arm/joint1", "gripper/width"), ("rad", "m")
    entries = dict.fromkeys(("observation.state", "action"), names)
    both = dict.fromkeys(entries, units)
    writer = DatasetWriter(folder, DatasetFormat(fps, entries, ("node",), {camera: (32, 48)}, "bench", both))
    for seed in seeds:
        for step in range(12):
            values = {name: [0.1 * step, 0.04] for name in entries}
            node = "all/Grasp::3" if step < 5 else "all/Place::4"
            writer.add_frame({**values, "node": node}, {camera: np.full((32, 48, 3), 20 * step, np.uint8)})
        writer.end_episode(task, seed=seed, **about)


def test_info_prints_what_is_in_a_dataset(bestman_bt: Command, folder: Path) -> None:
    write(folder / "set", range(1000, 1006, 2))
    text = bestman_bt("dataset", "info", "set").out
    assert "3 episodes, 36 frames at 10 Hz (4 s)" in text
    assert "task 'pick': 3 episodes, seeds 1000, 1002, 1004" in text
    assert "action: float32 2: arm/joint1 [rad], gripper/width [m]" in text
    document = json.loads(bestman_bt("dataset", "info", "set", "--json").out)
    assert document["tasks"] == [{"task": "pick", "episodes": 3, "seeds": [1000, 1002, 1004]}]
    assert document["bytes"] == sum(path.stat().st_size for path in (folder / "set").rglob("*") if path.is_file())


def test_info_tells_of_failed_episodes_beside_and_counts_them_apart(bestman_bt: Command, folder: Path) -> None:
    write(folder / "set", range(1000, 1003))
    alone = json.loads(bestman_bt("dataset", "info", "set", "--json").out)
    assert alone["failures"] is None
    write(folder / "set/failures", range(1003, 1005), outcome="failure", error_code="missed")
    beside = json.loads(bestman_bt("dataset", "info", "set", "--json").out)
    apart = json.loads(bestman_bt("dataset", "info", "set/failures", "--json").out)
    assert beside == {**alone, "failures": apart}
    assert apart["tasks"] == [{"task": "pick", "episodes": 2, "seeds": [1003, 1004]}]
    assert "failed episodes apart, in set/failures: 2, 24 frames" in bestman_bt("dataset", "info", "set").out


def test_info_tells_of_a_collect_without_a_success(bestman_bt: Command, folder: Path) -> None:
    write(folder / "set/failures", range(1003, 1005), outcome="failure", error_code="missed")
    (folder / "set/attempts.jsonl").write_text("{}\n{}\n")
    answer = bestman_bt("dataset", "info", "set")
    assert (answer.code, answer.out.splitlines()[0][:42]) == (0, "set: 0 episodes, 0 frames at 10 Hz (0 s), ")
    assert "failed episodes apart, in set/failures: 2, 24 frames" in answer.out
    document = json.loads(bestman_bt("dataset", "info", "set", "--json").out)
    assert (document["episodes"], document["failures"]["episodes"]) == (0, 2)
    shutil.rmtree(folder / "set/failures")
    none = bestman_bt("dataset", "info", "set")
    assert none.code == 2
    assert "set holds no episodes: collect has tried 2 seeds, which attempts.jsonl lists" in none.err


def test_shards_are_merged_with_their_failures_beside_and_failures_do_not_mix_with_successes(
    bestman_bt: Command, folder: Path
) -> None:
    for name, seed in (("one", 0), ("two", 5)):
        write(folder / name, range(seed, seed + 2))
        write(folder / name / "failures", range(seed + 2, seed + 3), outcome="failure", error_code=f"missed {name}")
    mixed = bestman_bt("dataset", "merge", "one", "one/failures", "-o", "mixed")
    assert mixed.code == 2
    assert "its episodes are described by other columns: error_code, outcome" in mixed.err
    assert bestman_bt("dataset", "merge", "one", "two", "-o", "both").code == 0
    assert not (folder / "both/failures").exists()
    assert bestman_bt("dataset", "merge", "one/failures", "two/failures", "-o", "both/failures").code == 0
    assert [row["seed"] for row in DatasetFolder.read(folder / "both").episodes] == [0, 1, 5, 6]
    failures = DatasetFolder.read(folder / "both/failures").episodes
    assert [(row["seed"], row["error_code"]) for row in failures] == [(2, "missed one"), (7, "missed two")]


def test_view_draws_an_episode_with_its_pictures(bestman_bt: Command, folder: Path) -> None:
    write(folder / "set", range(2))
    answer = bestman_bt("dataset", "view", "set", "--episode", "1", "--png", "one.png")
    assert answer.code == 0
    assert answer.out == "written: one.png\n"
    drawn = np.asarray(Image.open(folder / "one.png").convert("RGB"))
    white = (drawn == 255).all(axis=2).mean()
    assert 0.2 < white < 0.9
    late = (np.abs(drawn.astype(int) - 220) < 6).all(axis=2).sum()  # the last picture: 11 × 20
    assert late > 500


@pytest.mark.parametrize(
    "names",
    [None, {"motors": ["m0", "m1"]}, {"m1": 1, "m0": 0}],
    ids=["without names", "names of a group", "numbers by name"],
)
def test_datasets_that_name_their_entries_otherwise_are_described_and_drawn(
    bestman_bt: Command, folder: Path, names: object
) -> None:
    write(folder / "set", range(1))
    file = folder / "set/meta/info.json"
    info = json.loads(file.read_text())
    for feature in ("observation.state", "action"):
        info["features"][feature]["names"] = names
        info["features"][feature].pop("units", None)
    file.write_text(json.dumps(info))
    described = bestman_bt("dataset", "info", "set").out
    assert ("  action: float32 2: m0, m1\n" in described) == (names is not None)
    assert bestman_bt("dataset", "view", "set", "--png", "one.png").code == 0
    assert (folder / "one.png").stat().st_size > 1000


@pytest.mark.parametrize("content", [None, b"not a video"], ids=["missing", "damaged"])
def test_a_video_that_cannot_be_read_is_named(bestman_bt: Command, folder: Path, content: bytes | None) -> None:
    write(folder / "set", range(1))
    (video,) = (folder / "set").rglob("*.mp4")
    video.unlink()
    if content is not None:
        video.write_bytes(content)
    for command in (("view", "set"), ("merge", "set", "-o", "both")) if content is None else (("view", "set"),):
        answer = bestman_bt("dataset", *command)
        assert answer.code == 2
        assert video.name in answer.err
        assert "Traceback" not in answer.err
    assert not (folder / "both").exists()


def test_merge_copies_the_videos_as_they_are(bestman_bt: Command, folder: Path) -> None:
    write(folder / "one", range(2))
    write(folder / "two", range(1, 2), task="place")
    answer = bestman_bt("dataset", "merge", "one", "two", "-o", "both")
    assert answer.code == 0
    assert "3 episodes of 2 datasets" in answer.out
    video = "videos/observation.images.head/chunk-000/file-{:03d}.mp4"
    assert (folder / "both" / video.format(2)).read_bytes() == (folder / "two" / video.format(0)).read_bytes()
    merged = DatasetFolder.read(folder / "both")
    assert [(row["seed"], row["tasks"]) for row in merged.episodes] == [(0, ["pick"]), (1, ["pick"]), (1, ["place"])]
    assert "task 'pick': 2 episodes, seeds 0 to 1" in bestman_bt("dataset", "info", "both").out


def test_merge_refuses_other_formats_and_common_seeds_with_all_differences(bestman_bt: Command, folder: Path) -> None:
    write(folder / "one", range(2))
    write(folder / "two", range(1, 3), fps=20, camera="wrist")
    answer = bestman_bt("dataset", "merge", "one", "two", "-o", "both")
    assert answer.code == 2
    for words in (
        "fps is 20, not 10 as in one",
        "feature observation.images.head is missing",
        "feature observation.images.wrist is additional",
        "has seed 1 of 'pick', which one has too",
    ):
        assert words in answer.err
    assert not (folder / "both").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("info", "nothing"), "nothing is not a dataset of LeRobot"),
        (("view", "set", "--episode", "2"), "--episode: should be below 2, got 2"),
        (("replay", "set"), "episode 0 does not say which run it is; collect writes it"),
        (("merge", "set", "-o", "set"), "set exists already; name a new folder"),
    ],
)
def test_wrong_input_ends_with_code_2(
    bestman_bt: Command, folder: Path, arguments: tuple[str, ...], words: str
) -> None:
    write(folder / "set", range(2))
    answer = bestman_bt("dataset", *arguments)
    assert answer.code == 2
    assert words in answer.err
