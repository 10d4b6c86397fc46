"""Datasets whose episodes run on a cluster of this machine."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.collection import ATTEMPTS, Collection
from bestman_bt.evaluation.launchers.launcher import LaunchOptions
from bestman_bt.extras import is_installed
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetFolder
from bestman_bt.registry import LAUNCHERS

SEED = 4100

pytestmark = [pytest.mark.timeout(600), pytest.mark.slow]


FAILS = """<root BTCPP_format="4"><BehaviorTree ID="Main">
  <Sequence><Sleep msec="500"/><AlwaysFailure/></Sequence>
</BehaviorTree></root>"""


@pytest.mark.parametrize("fails", [False, True], ids=["success", "failures"])
@pytest.mark.parametrize(("name", "executor"), [("ray", ""), ("slurm", "local"), ("slurm", "slurm")])
def test_a_cluster_writes_the_same_datasets_as_this_process(
    name: str,
    executor: str,
    fails: bool,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    if not is_installed(name):
        pytest.skip(f"the extra {name} is not installed: make test-cluster")
    if executor == "slurm":
        request.getfixturevalue("slurm")
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    (tmp_path / "fails.xml").write_text(FAILS)
    config = load_run("pick_bench", tree=tmp_path / "fails.xml" if fails else None, seed=SEED)
    there = tmp_path / "there"
    launcher = LAUNCHERS.resolve(name)(LaunchOptions(2, folder=there), *[executor] * bool(executor))
    for folder, runs in ((tmp_path / "here", None), (there, launcher)):
        collection = Collection(config, folder, "pick", ())
        collection.collect(1, 2, lambda result: None, runs)
        assert (collection.kept, collection.failures) == ((0, 2) if fails else (1, 0))
    here, other = (DatasetFolder.read(one / FAILURES if fails else one) for one in (tmp_path / "here", there))
    assert other.episodes == here.episodes
    assert [other.data(episode) for episode in range(len(other.episodes))] == [
        here.data(episode) for episode in range(len(here.episodes))
    ]
    told = [(tmp_path / name / ATTEMPTS).read_text() for name in ("here", "there")]
    assert told[0] == told[1]
