"""Episodes as an array job: by submitit's executor of this machine, and on a real Slurm where there can be one."""

from __future__ import annotations

import base64
import os
import pickle
import signal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest, load_run
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.launchers import slurm_array
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, LaunchOptions
from bestman_bt.evaluation.launchers.slurm_array import SlurmArray
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer
from bestman_bt.evaluation.suite import Suite, make_suite
from bestman_bt.extras import is_installed
from tests.evaluation.launchers.journal_lines import without_times
from tests.evaluation.test_summary import result

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


class ShortExecutor:
    """Runs the episodes of each task at once; that of seed 2 ends its task."""

    def __init__(self, folder: Path, cluster: str) -> None:
        self.folder = folder

    def update_parameters(self, **_: object) -> None: ...

    def map_array(self, _: object, shares: list[Any], files: list[str], folders: list[str]) -> list[Any]:
        for share, file in zip(shares, files, strict=True):
            with Path(file).open("ab") as answers:
                for place, (request, _limit) in share:
                    seed = pickle.loads(request).config.seed
                    if seed == 2:
                        break
                    answer = EpisodeAnswer(result=pickle.dumps(result(seed)))
                    answers.write(f"{place} ".encode() + base64.b64encode(pickle.dumps(answer)) + b"\n")
        return [SimpleNamespace(job_id=f"7_{number}", done=lambda: True) for number in range(len(shares))]


def test_an_episode_whose_task_ends_each_time_has_no_result_and_those_behind_it_are_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(slurm_array, "POLL", 0.0)
    monkeypatch.setattr(slurm_array, "import_module", lambda _: SimpleNamespace(AutoExecutor=ShortExecutor))
    launcher = SlurmArray(LaunchOptions(1, folder=tmp_path), "local")
    launcher.submit([EpisodeRequest(load_run("fetch_cup", seed=seed)) for seed in range(5)])
    found = list(launcher.results())
    assert sorted((place, one.seed) for place, one in found) == [(seed, seed) for seed in (0, 1, 3, 4)]
    assert launcher.given_up == {2: "its task of Slurm was lost"}
    assert launcher.notes == ["2 times an episode was run again: its task of Slurm was lost"]


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
