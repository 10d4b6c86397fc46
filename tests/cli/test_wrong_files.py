"""All faults of a file in one round: what is told of a line of ``wrong_files`` stands behind ``#!``; no more is told.

Behind ``#1`` stands what is told of a field that is missing, at no line or at the first one.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.run import RunRequest, run_of_options
from bestman_bt.errors import InputError
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.suite import load_suite
from bestman_bt.navigation.map_file import read_map
from bestman_bt.robot_model.compose import load_robot_model
from bestman_bt.runtime.calibration.dataset import load_dataset
from bestman_bt.scene.furniture_file import read_furniture
from bestman_bt.scene.load import load_scene
from bestman_bt.scene.object_file import read_object

FOLDER = Path(__file__).parent / "wrong_files"
_TOLD = re.compile(r"(?:.*?/)?([\w.]+\.\w+):(?:(\d+):)? (.*)")


def prepare_task(path: Path) -> None:
    faults: list[Any] = []
    prepare_episode(run_of_options(RunRequest(path), faults), faults)


READERS: dict[str, Callable[[Path], object]] = {
    "calibrated": load_robot_model,
    "dataset": lambda path: load_dataset(path.parent),
    "furniture": read_furniture,
    "map": read_map,
    "object": read_object,
    "robot": load_robot_model,
    "scene": load_scene,
    "suite": load_suite,
    "task": prepare_task,
}
FILES = [path for path in sorted(FOLDER.rglob("*.yaml")) if path.stem.partition("_")[0] in READERS]


def marks(path: Path) -> list[tuple[str, int | None, str]]:
    """File, line and words of all that is to be told."""
    found: list[tuple[str, int | None, str]] = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for sign, words in re.findall(r"#([!1]) (.*?)(?: -->)?$", line):
            found += [(path.name, number if sign == "!" else None, one.strip()) for one in words.split("|")]
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.relative_to(FOLDER).as_posix())
def test_one_round_reports_all_that_is_wrong_with_a_file_and_no_more(path: Path) -> None:
    beside = [path.with_name(name) for name in re.findall(r"\b(?:calibration_\d+\.yaml|\w+\.xml)", path.read_text())]
    owed = [mark for file in (path, *beside) if file.is_file() for mark in marks(file)]
    with pytest.raises(InputError) as error:
        READERS[path.stem.partition("_")[0]](path)
    left = str(error.value).splitlines()
    for file, line, words in owed:
        at = [_TOLD.fullmatch(one) for one in left]
        fitting = [m for m in at if m and m[1] == file and (line is None or m[2] == str(line)) and words in m[3]]
        assert fitting, f"{file}:{line}: {words!r} is not told; left are {left}"
        left.remove(fitting[0][0])
    assert not left
