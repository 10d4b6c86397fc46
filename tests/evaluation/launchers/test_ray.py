"""Episodes on several raylets: what is killed loses and doubles nothing, and the figures are those of one process."""

from __future__ import annotations

import errno
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunRequest, load_run
from bestman_bt.evaluation.code_version import code_fingerprint
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.launchers import ray_tasks
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, LaunchOptions
from bestman_bt.evaluation.launchers.ray_tasks import RayTasks
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.suite import Suite, make_suite
from bestman_bt.extras import is_installed
from bestman_bt.monitor.control_client import ask_events, running_executors
from tests.evaluation.launchers.journal_lines import without_times
from tests.evaluation.launchers.ray_cluster import OPTIONS, RayCluster

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(600),
    pytest.mark.skipif(not is_installed("ray"), reason="the extra ray is not installed: make test-cluster"),
]

SEEDS = 6
MISMATCH = """Version mismatch: The cluster was started with:
    Ray: 2.60.0
    Python: 3.12.1
This process on node 127.0.0.1 was started with:
    Ray: 2.60.0
    Python: 3.11.7
"""
"""What Ray 2.60 says of a head in Python 3.12."""


@pytest.fixture
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Suite:
    """A tree that does nothing, as often as there are seeds."""
    monkeypatch.chdir(tmp_path)
    for name, value in OPTIONS.items():
        monkeypatch.setenv(name, value)
    (tmp_path / "t.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysSuccess/></BehaviorTree></root>'
    )
    (tmp_path / "t.yaml").write_text("tree: t.xml\nscene: kitchen\nrobot: diff_panda\n")
    return make_suite(["t.yaml"], SEEDS, 0, RunRequest())


@pytest.fixture(scope="module")
def cluster() -> Iterator[RayCluster]:
    with RayCluster() as running:
        yield running


def command(address: str, folder: Path) -> subprocess.Popen[str]:
    """The evaluation as a program of its own."""
    asked = [sys.executable, "-m", "bestman_bt.cli.main", "eval", "t.yaml", "--episodes", str(SEEDS)]
    return subprocess.Popen(
        [*asked, "--launcher", "ray", "--address", address, "--out", str(folder)], stderr=subprocess.PIPE, text=True
    )


def wait_for_an_episode(folder: Path, process: subprocess.Popen[str]) -> None:
    journal = folder / "episodes.jsonl"
    while not (journal.exists() and journal.read_text()):
        assert process.poll() is None, process.stderr and process.stderr.read()
        time.sleep(0.05)


def test_killed_nodes_and_drivers_lose_and_double_nothing(suite: Suite, cluster: RayCluster, tmp_path: Path) -> None:
    with Evaluation(suite, tmp_path / "local") as evaluation:
        local = evaluation.run()
    expected = without_times(tmp_path / "local", SEEDS)

    killed: list[int] = []

    def kill_a_node_once(*_: Any) -> None:
        if not killed:
            killed.append(1)
            cluster.kill_node()

    with Evaluation(suite, tmp_path / "node") as evaluation:
        document = evaluation.run(RayTasks(LaunchOptions(address=cluster.address)), kill_a_node_once)
    assert without_times(tmp_path / "node", SEEDS) == expected
    assert (document["met"], document["code"]) == (True, local["code"])

    driver = command(cluster.address, tmp_path / "driver")
    wait_for_an_episode(tmp_path / "driver", driver)
    driver.kill()
    driver.communicate()
    again = command(cluster.address, tmp_path / "driver")
    _, told = again.communicate()
    assert again.returncode == 0, told
    assert "episodes are finished already" in told
    assert without_times(tmp_path / "driver", SEEDS) == expected


def test_monitors_of_the_driver_see_episodes_of_nodes_that_are_elsewhere(
    suite: Suite, cluster: RayCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sleeps.xml").write_text(
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><Sleep msec="60000"/></BehaviorTree></root>'
    )
    with tempfile.TemporaryDirectory() as here, ThreadPoolExecutor(1) as pool:
        monkeypatch.setenv("XDG_RUNTIME_DIR", here)
        launcher = RayTasks(LaunchOptions(address=cluster.address, monitor=True))
        launcher.submit(
            [EpisodeRequest(load_run("pick_bench", tree=tmp_path / "sleeps.xml", seed=3), code=code_fingerprint())]
        )
        results = pool.submit(lambda: list(launcher.results()))
        while not (sockets := running_executors()):
            assert not results.done()
            time.sleep(0.05)
        events = [json.loads(line) for line in ask_events(sockets[0], ["states"])]
        assert [result.tree_status for _, result in results.result()] == ["SUCCESS"]
        launcher.cancel()
    assert (events[0]["task"], events[0]["seed"]) == ("pick_bench", 3)
    assert events[-1]["event"] == "end"


def test_a_driver_that_cannot_listen_at_its_address_shows_no_episodes_and_notes_it(
    suite: Suite, cluster: RayCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    launcher = RayTasks(LaunchOptions(address=cluster.address, monitor=True))
    monkeypatch.setattr("ray.util.get_node_ip_address", lambda: "192.0.2.1")  # reserved for documentation
    with Evaluation(suite) as evaluation:
        document = evaluation.run(launcher)
    assert document["met"]
    (note,) = document["notes"]
    assert note.startswith("episodes of other machines are not shown: Cannot assign requested address")


def test_without_an_address_it_starts_a_ray_of_its_own_beside_one_that_runs(
    suite: Suite, cluster: RayCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RAY_ADDRESS", cluster.address)
    with Evaluation(suite) as evaluation:
        assert evaluation.run(RayTasks(LaunchOptions(1)))["met"]


def test_without_a_cluster_head_the_driver_reports_it_and_a_new_head_continues(suite: Suite, tmp_path: Path) -> None:
    with RayCluster() as lost:
        driver = command(lost.address, tmp_path / "out")
        wait_for_an_episode(tmp_path / "out", driver)
        lost.kill_head()
        _, told = driver.communicate()
    assert driver.returncode == 130, told
    assert f"the head of the Ray cluster at {lost.address} no longer answers; what has finished is kept" in told
    with Evaluation(suite, tmp_path / "out") as evaluation:
        assert evaluation.run()["met"]
    assert len(without_times(tmp_path / "out", SEEDS)) == SEEDS


def test_nodes_that_unpack_the_code_just_now_are_waited_for(
    suite: Suite, cluster: RayCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unpacked = tmp_path / "unpacked"

    def code_there() -> tuple[str, str]:
        if not unpacked.exists():
            unpacked.touch()
            raise ModuleNotFoundError("No module named 'bestman_bt'")
        return "c0de", ""

    monkeypatch.setattr(ray_tasks, "code_here", code_there)
    launcher = RayTasks(LaunchOptions(address=cluster.address))
    launcher.submit([EpisodeRequest(load_run("fetch_cup"), code="c0de")])
    launcher.cancel()
    assert unpacked.exists()


def function_only_here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a function of a module that no node has."""
    (folder / "only_here.py").write_text("def run(*_: object) -> None: ...")
    monkeypatch.syspath_prepend(str(folder))
    found = import_module("only_here")
    (folder / "only_here.py").unlink()
    return found.run


@pytest.mark.parametrize("missing", ["numpy", "only_here"])
def test_a_node_without_the_code_ends_the_evaluation_and_makes_no_result(
    suite: Suite, cluster: RayCluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    def without_numpy(*_: object) -> None:
        raise ModuleNotFoundError("No module named 'numpy'")

    runs = without_numpy if missing == "numpy" else function_only_here(tmp_path, monkeypatch)
    monkeypatch.setattr(ray_tasks, "run_in_own_process", runs)
    launcher = RayTasks(LaunchOptions(address=cluster.address))
    launcher.submit([EpisodeRequest(load_run("fetch_cup"), code=code_fingerprint())])
    with pytest.raises(LauncherLostError, match=f"a node cannot run episodes: .*No module named '{missing}'; what has"):
        list(launcher.results())
    launcher.cancel()


def test_an_episode_whose_task_fails_on_its_node_has_no_result(
    suite: Suite, cluster: RayCluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(ray_tasks, "run_in_own_process", fail)
    launcher = RayTasks(LaunchOptions(address=cluster.address))
    launcher.submit([EpisodeRequest(load_run("fetch_cup"), code=code_fingerprint())])
    assert list(launcher.results()) == []
    launcher.cancel()
    why = "its Ray task failed (OSError: [Errno 28] No space left on device)"
    assert launcher.given_up == {0: why}
    assert launcher.notes == [f"2 times an episode was run again: {why}"]


def test_a_cluster_of_another_python_is_refused_with_both_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    def init(**_: object) -> None:
        raise RuntimeError(MISMATCH)

    monkeypatch.setattr("ray.init", init)
    expected = r"cannot be used: Version mismatch: .* Python: 3.12.1 This .* Python: 3.11.7; use the same versions"
    with pytest.raises(ConfigurationError, match=expected):
        RayTasks().submit([EpisodeRequest(load_run("fetch_cup"))])


def test_nodes_with_other_code_and_addresses_without_a_head_are_refused(suite: Suite, cluster: RayCluster) -> None:
    request = EpisodeRequest(load_run("fetch_cup"), code="0ther")
    with pytest.raises(ConfigurationError) as refused:
        RayTasks(LaunchOptions(address=cluster.address)).submit([request])
    assert len(refused.value.problems) == 3
    assert "has other code" in str(refused.value)
    assert "here 0ther" in str(refused.value)
    with pytest.raises(ConfigurationError, match=r"--address: should be HOST:PORT of the head, .* got 'nohost'"):
        RayTasks(LaunchOptions(address="nohost"))
    with pytest.raises(ConfigurationError, match=r"--address: 127.0.0.1:9 does not answer; is its head running"):
        RayTasks(LaunchOptions(address="127.0.0.1:9")).submit([request])
