"""Datasets whose episodes run on a cluster of this machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.collection import Collection
from bestman_bt.evaluation.launchers.launcher import LaunchOptions
from bestman_bt.extras import is_installed
from bestman_bt.manipulation.policy.training.dataset_folder import DatasetFolder
from bestman_bt.registry import LAUNCHERS

SEED = 4100

pytestmark = [pytest.mark.timeout(600), pytest.mark.slow]


@pytest.mark.parametrize(("name", "executor"), [("ray", ""), ("slurm", "local"), ("slurm", "slurm")])
def test_a_cluster_writes_the_same_dataset_as_this_process(
    name: str, executor: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    if not is_installed(name):
        pytest.skip(f"the extra {name} is not installed: make test-cluster")
    if executor == "slurm":
        request.getfixturevalue("slurm")
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    config, there = load_run("pick_bench", seed=SEED), tmp_path / "there"
    launcher = LAUNCHERS.resolve(name)(LaunchOptions(2, folder=there), *[executor] * bool(executor))
    for folder, runs in ((tmp_path / "here", None), (there, launcher)):
        collection = Collection(config, folder, "pick", ())
        collection.collect(1, 2, lambda result: None, runs)
        assert collection.kept == 1
    assert DatasetFolder.read(there).data(0) == DatasetFolder.read(tmp_path / "here").data(0)
