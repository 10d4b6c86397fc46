"""Datasets against LeRobot: the layouts that it writes, recorded from it, and its own loaders where installed."""

from __future__ import annotations

import json
import os
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as parquet
import pytest

from bestman_bt.manipulation.policy.training.dataset_folder import DatasetFolder
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetFormat, DatasetWriter

HERE = Path(__file__).parent
ENVIRONMENTS = Path(__file__).resolve().parents[3] / "build/lerobot"
VERSIONS = ("0.4.4", "0.6.1")
PAIR = ("a", "b")
FORMAT = DatasetFormat(10, {"observation.state": PAIR, "action": PAIR}, ("node",), {"head": (96, 128)}, "bench")


def write(folder: Path, lengths: tuple[int, ...], frames: DatasetFormat = FORMAT, **about: str) -> Path:
    writer = DatasetWriter(folder, frames)
    for length in lengths:
        for step in range(length):
            values = {"observation.state": [step, 0.5], "action": [length, step], "node": "x", "subtask": ""}
            values["subtask"] = "grasp (object cup)" if step < 3 else "place on (object cup)"
            writer.add_frame(values, {"head": np.full((96, 128, 3), 20 * step, np.uint8)})
        writer.end_episode("pick", **about)
    return folder


def recorded(version: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((HERE / f"lerobot_schemas/{version}.json").read_text())
    return found


def types(path: Path) -> dict[str, str]:
    return {field.name: str(field.type) for field in parquet.read_schema(path)}


@pytest.mark.parametrize("version", VERSIONS)
def test_files_have_the_columns_and_types_that_lerobot_writes(version: str, tmp_path: Path) -> None:
    written, theirs = write(tmp_path / "set", (5,)), recorded(version)
    assert types(written / "data/chunk-000/file-000.parquet") == theirs["data"]
    rows = types(written / "meta/episodes/chunk-000/file-000.parquet")
    counters = {
        f"stats/{name}/{end}"
        for name in ("frame_index", "episode_index", "index", "task_index")
        for end in ("min", "max")
    }  # int64 in 0.4.4, double in 0.6.1
    assert {name: kind for name, kind in rows.items() if name not in counters} == {
        name: kind for name, kind in theirs["episodes"].items() if name not in counters
    }
    assert counters <= rows.keys()
    info = json.loads((written / "meta/info.json").read_text())
    assert info.keys() == theirs["info"].keys()
    video = "observation.images.head"
    assert info["features"].pop(video)["shape"] == theirs["info"]["features"].pop(video)["shape"]
    assert info == theirs["info"]


def environment(version: str) -> Path:
    python = ENVIRONMENTS / version / "bin/python"
    if not python.exists():
        pytest.skip(f"LeRobot {version} is not installed: make test-lerobot")
    return python


def run(python: Path, program: str, *arguments: Path) -> str:
    variables = {**os.environ, "HF_HUB_OFFLINE": "1"}
    command = [str(python), str(HERE / program), *map(str, arguments)]
    done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_what_was_recorded_of_lerobot_is_what_it_writes(version: str, tmp_path: Path) -> None:
    run(environment(version), "record_lerobot_schema.py", tmp_path / "schema.json")
    assert json.loads((tmp_path / "schema.json").read_text()) == recorded(version)


@pytest.mark.slow
@pytest.mark.parametrize(("version", "subtasks"), [("0.4.4", False), ("0.6.1", False), ("0.6.1", True)])
def test_the_loader_of_lerobot_reads_what_was_written_and_merged(version: str, subtasks: bool, tmp_path: Path) -> None:
    frames = replace(FORMAT, subtasks=subtasks)
    units = replace(frames, units={"action": ("rad", "m")})
    merged = DatasetFolder.read(write(tmp_path / "set", (5, 4), units))
    merged.append(DatasetFolder.read(write(tmp_path / "more", (6,), units)))
    lines = run(environment(version), "read_with_lerobot.py", merged.path).splitlines()
    read = [json.loads(line) for line in lines if line.startswith("{")]
    expected = [(episode, length, step) for episode, length in enumerate((5, 4, 6)) for step in range(length)]
    assert [(one["episode"], *one["action"]) for one in read] == expected
    assert [one["index"] for one in read] == list(range(15))
    assert {(one["node"], one["task"]) for one in read} == {("x", "pick")}
    bounds = {"q01": [4.0, pytest.approx(0.03)], "q99": [6.0, pytest.approx(4.95)]}
    for one in read:
        assert one["quantiles"] == bounds
        assert one["brightness"] == pytest.approx(20 * one["action"][1] / 255, abs=0.02)
        assert one["subtasks"] == (["grasp (object cup)", "place on (object cup)"] if subtasks else [])


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
def test_the_loader_of_lerobot_reads_failed_episodes_apart_from_the_successes_above(
    version: str, tmp_path: Path
) -> None:
    successes = write(tmp_path / "set", (5,))
    failures = write(tmp_path / "set/failures", (3, 2), outcome="failure", failed_node="", why="blocked")
    for folder, lengths in ((successes, (5,)), (failures, (3, 2))):
        lines = run(environment(version), "read_with_lerobot.py", folder).splitlines()
        read = [json.loads(line)["action"] for line in lines if line.startswith("{")]
        assert read == [[length, step] for length in lengths for step in range(length)]
