"""Datasets whose episodes run on a cluster of this machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.collection import Collection
from bestman_bt.evaluation.launchers.launcher import Launcher, LaunchOptions
from bestman_bt.extras import is_installed
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetFolder
from bestman_bt.registry import LAUNCHERS

SEED = 4100

pytestmark = [pytest.mark.timeout(600), pytest.mark.slow]


def launcher(name: str, folder: Path) -> Launcher:
    options = LaunchOptions(2, folder=folder)
    made = LAUNCHERS.resolve(name)
    return made(options, "local") if name == "slurm" else made(options)  # submitit's executor of this machine


@pytest.mark.parametrize("name", ["ray", "slurm"])
def test_a_cluster_writes_the_same_dataset_as_this_process(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not is_installed(name):
        pytest.skip(f"the extra {name} is not installed: make test-cluster")
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    config = load_run("pick_bench", seed=SEED)
    for folder, runs in (("here", None), (name, launcher(name, tmp_path / name))):
        collection = Collection(config, tmp_path / folder, "pick", ())
        collection.collect(1, 2, lambda result: None, runs)
        assert collection.kept == 1
    assert DatasetFolder.read(tmp_path / name).data(0) == DatasetFolder.read(tmp_path / "here").data(0)
