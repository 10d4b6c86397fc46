"""A disk that takes nothing more ends what is written of a run, not the run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.command_line import Answer

pytestmark = pytest.mark.slow

TREE = """
import resource

import py_trees

from behaviours.navigation.navigate import NavigateTo
from bestman_bt.engine import Sequence


class FillDisk(py_trees.behaviour.Behaviour):

    def update(self):
        resource.setrlimit(resource.RLIMIT_FSIZE, ({most}, resource.RLIM_INFINITY))
        return py_trees.common.Status.SUCCESS


def build():
    return Sequence([FillDisk("fill_disk"), NavigateTo(goal="1.2;-0.4;0")])
"""


def driven(folder: Path, most: int, *arguments: str) -> Answer:
    """A drive in the kitchen on a disk that is full, for files beyond ``most`` bytes, when the tree begins."""
    (folder / "drive.py").write_text(TREE.format(most=most))
    words = [sys.executable, "-m", "bestman_bt.cli.main", "run", "drive.py", "--scene", "kitchen", "--seed", "1"]
    ran = subprocess.run([*words, *arguments], cwd=folder, capture_output=True, text=True, timeout=200.0, check=False)
    return Answer(ran.returncode, ran.stdout, ran.stderr)


def test_logs_and_recordings_end_with_one_loud_line_and_the_run_goes_on(tmp_path: Path) -> None:
    answer = driven(tmp_path, 6_000, "--json", "--pictures", "--record")
    assert answer.code == 0, answer.err
    (folder,) = (tmp_path / "runs").iterdir()
    large = {"the run's logs", "motion.jsonl", "recording.rrd", "readings.jsonl.gz", "end.png"}
    assert large <= set(answer.document["not_kept"])
    assert answer.document["outcome"] == "success"
    assert json.loads((folder / "result.json").read_text()) == answer.document
    assert answer.err.count("NOT KEPT") == 1
    assert "Traceback" not in answer.err


@pytest.mark.parametrize("arguments", [("--json",), ()], ids=["asked for as JSON", "not asked for"])
def test_a_result_that_cannot_be_written_is_printed(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    answer = driven(tmp_path, 1_000, *arguments)
    assert answer.code == 0, answer.err
    (folder,) = (tmp_path / "runs").iterdir()
    assert not list(folder.glob("result.json*"))
    document = json.loads(answer.out.splitlines()[-1])
    assert (document["outcome"], document["not_kept"]["result.json"]) == ("success", "File too large")


def test_a_run_whose_configuration_cannot_be_written_does_not_begin(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "bestman_bt.cli.main", "run", "--task", "navigate_kitchen", "--json"]
    limited = ["bash", "-c", 'ulimit -f 0; exec "$@"', "bash", *words]
    answer = subprocess.run(limited, cwd=tmp_path, capture_output=True, text=True, timeout=100.0, check=False)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert "no run folder can be made there: File too large" in answer.stderr
