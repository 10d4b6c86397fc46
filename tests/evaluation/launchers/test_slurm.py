"""Episodes as an array job: by submitit's executor of this machine, and on a real Slurm where there can be one."""

from __future__ import annotations

import base64
import os
import pickle
import signal
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.launchers import slurm_array
from bestman_bt.evaluation.launchers.launcher import LaunchOptions
from bestman_bt.evaluation.launchers.slurm_array import SlurmArray
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer
from bestman_bt.evaluation.suite import Suite, make_suite
from bestman_bt.extras import is_installed
from tests.evaluation.launchers.journal_lines import without_times

SEEDS = 6

pytestmark = [
    pytest.mark.timeout(600),
    pytest.mark.skipif(not is_installed("slurm"), reason="the extra slurm is not installed: make test-cluster"),
]


@pytest.fixture
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Suite:
    """A tree that does nothing, as often as there are seeds."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
    )
    (tmp_path / "t.yaml").write_text("tree: t.xml\nscene: kitchen\nrobot: diff_panda\n")
    return make_suite(["t.yaml"], SEEDS, 0, RunRequest())


def run(suite: Suite, folder: Path, executor: str, on_result: Any = None) -> dict[str, Any]:
    with Evaluation(suite, folder) as evaluation:
        return evaluation.run(SlurmArray(LaunchOptions(2, folder=folder), executor), on_result)


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["local", "slurm"])
def test_a_task_that_is_killed_loses_and_doubles_nothing(
    suite: Suite, tmp_path: Path, executor: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if executor == "slurm":
        request.getfixturevalue("slurm")
    monkeypatch.setattr(slurm_array, "POLL", 0.2)
    with Evaluation(suite, tmp_path / "here") as evaluation:
        evaluation.run()
    killed: list[int] = []

    def kill_a_task_once(*_: Any) -> None:
        """By the scripts that submitit runs, below the evaluation's folder."""
        if not killed:
            for process in Path("/proc").glob("[0-9]*"):
                line = (process / "cmdline").read_bytes().split(b"\0") if (process / "cmdline").exists() else []
                if b"submitit.core._submit" in line and str(tmp_path).encode() in b" ".join(line):
                    killed.append(int(process.name))
            os.kill(killed[-1], signal.SIGKILL)

    document = run(suite, tmp_path / executor, executor, kill_a_task_once)
    assert killed
    assert document["met"]
    assert without_times(tmp_path / executor, SEEDS) == without_times(tmp_path / "here", SEEDS)


def test_a_task_that_slurm_starts_again_goes_on_behind_its_last_whole_answer(tmp_path: Path) -> None:
    file = tmp_path / "answers"
    whole = b"4 " + base64.b64encode(pickle.dumps(EpisodeAnswer(crashed="code 3"))) + b"\n"
    file.write_bytes(whole + b"5 gASV")
    slurm_array.run_share([(4, (b"never run", 1.0))], str(file), ".")
    assert file.read_bytes() == whole


def test_without_sbatch_slurm_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ConfigurationError, match="--launcher slurm: sbatch was not found: run the command where jobs"):
        SlurmArray()
    with pytest.raises(ConfigurationError, match="--address: is not for slurm"):
        SlurmArray(LaunchOptions(address="a:1"), "local")
