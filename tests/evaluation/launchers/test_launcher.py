"""The seam between an evaluation and what runs its episodes: what may travel, and who may run it."""

from __future__ import annotations

import errno
import inspect
import os
import pickle
import platform
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.evaluation.code_version import code_fingerprint
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.interval import Precision
from bestman_bt.evaluation.launchers import launcher as launcher_module
from bestman_bt.evaluation.launchers import worker_process
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher, LaunchOptions
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer, LauncherLostError
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.suite import Suite, SuiteEntry
from bestman_bt.registry import LAUNCHERS
from tests.evaluation.test_summary import result


@pytest.fixture
def request_of_one() -> EpisodeRequest:
    return EpisodeRequest(load_run("fetch_cup", seed=4))


@pytest.mark.parametrize("name", LAUNCHERS.names())
def test_every_launcher_is_one(name: str) -> None:
    launcher = LAUNCHERS.resolve(name)
    assert issubclass(launcher, Launcher)
    assert not inspect.isabstract(launcher)


def test_a_request_travels(request_of_one: EpisodeRequest) -> None:
    assert pickle.loads(request_of_one.pickled()) == request_of_one


def test_a_request_with_a_value_that_cannot_travel_is_refused(request_of_one: EpisodeRequest) -> None:
    config = request_of_one.config.changed(scene_settings={"mine": lambda: 1})
    with pytest.raises(ConfigurationError, match=r"task fetch_cup: cannot be sent to another process: .*FILE.py:Class"):
        replace(request_of_one, config=config).pickled()


def test_a_process_with_other_code_refuses_an_episode(request_of_one: EpisodeRequest) -> None:
    assert replace(request_of_one, code=code_fingerprint()).refusal_here() == ""
    assert request_of_one.refusal_here() == ""
    other = replace(request_of_one, code="0ther").refusal_here()
    assert f"has other code: {code_fingerprint()}, here 0ther; install the same version of bestman-bt" in other
    with pytest.raises(LauncherLostError, match=r"^node9 has other code"):
        LocalProcesses().take(0, EpisodeAnswer(refused="node9 has other code"))


def test_what_an_answer_stands_for(request_of_one: EpisodeRequest) -> None:
    launcher = LocalProcesses()
    launcher.submit([request_of_one])
    sent = result(4).to_document()
    got = launcher.take(0, EpisodeAnswer(result=pickle.dumps(result(4))))
    assert got is not None
    assert got.to_document() == sent
    crashed = launcher.take(0, EpisodeAnswer(crashed="the process ended with code 3", seconds=2.0))
    assert crashed is not None
    assert (crashed.seed, crashed.outcome, crashed.wall_time_s) == (4, Outcome.ERROR, 2.0)
    assert launcher.notes == []
    assert launcher.take(0, EpisodeAnswer(lost="node lost")) is None
    assert launcher.take(0, EpisodeAnswer(lost="code replaced")) is None
    assert launcher.notes == [
        "1 times an episode was run again: node lost",
        "1 times an episode was run again: code replaced",
    ]
    assert not launcher.given_up
    assert launcher.take(0, EpisodeAnswer(lost="node lost")) is None
    assert launcher.given_up == {0: "node lost"}


def lose(launcher: Launcher, places: Sequence[int], by_machine: bool = False) -> None:
    for place in places:
        for _ in range(3):
            assert launcher.take(place, EpisodeAnswer(lost="the disk is full", by_machine=by_machine)) is None


def test_a_launcher_that_only_loses_episodes_is_lost(request_of_one: EpisodeRequest) -> None:
    launcher = LocalProcesses()
    launcher.submit([request_of_one] * 9)
    lose(launcher, [0, 1])
    with pytest.raises(LauncherLostError, match=r"^no episode has ended, each one lost its worker: the disk is full"):
        lose(launcher, [2])
    launcher.take(8, EpisodeAnswer(crashed="the process ended with code 3"))
    lose(launcher, [3, 4, 5, 6, 7])
    assert len(launcher.given_up) == 8


def test_a_launcher_whose_machines_lose_episode_after_episode_is_lost(request_of_one: EpisodeRequest) -> None:
    launcher = LocalProcesses()
    launcher.submit([request_of_one] * 9)
    for places in ([0, 1], [2, 3]):
        launcher.take(8, EpisodeAnswer(crashed="the process ended with code 3"))
        lose(launcher, places, by_machine=True)
    with pytest.raises(LauncherLostError, match=r"^9 episodes in a row were lost: the disk is full; what has finished"):
        lose(launcher, [4], by_machine=True)


class Losing(LocalProcesses):
    """Loses the workers of one seed."""

    LOST = 5

    def is_lost(self, config: RunConfig) -> bool:
        return config.seed == self.LOST

    def results(self) -> Iterator[tuple[int, RunResult]]:
        while self._waiting:
            place = self._waiting.popleft()
            config = self.requests[place].config
            made = replace(result(config.seed), success=config.seed % 2 == 0)
            answer = EpisodeAnswer(lost="killed") if self.is_lost(config) else EpisodeAnswer(pickle.dumps(made))
            taken = self.take(place, answer)
            if taken is not None:
                yield place, taken
            elif place not in self.given_up:
                self._waiting.append(place)


def test_an_episode_whose_workers_are_lost_is_missing_and_run_by_the_next_command(tmp_path: Path) -> None:
    suite = Suite("mine", (SuiteEntry("one", load_run("fetch_cup", seed=4), 4),))
    with Evaluation(suite, tmp_path) as evaluation:
        document = evaluation.run(Losing())
    assert (document["episodes"], document["interrupted"], document["met"]) == (3, True, False)
    assert document["entries"][0]["missing"] == [Losing.LOST]
    assert document["notes"] == [
        "one: no result for seed 5 after 3 runs: killed",
        "2 times an episode was run again: killed",
    ]
    ran = Losing()
    ran.LOST = 0
    with Evaluation(suite, tmp_path) as evaluation:
        assert evaluation.run(ran)["episodes"] == 4
    assert [request.config.seed for request in ran.requests] == [5]


class LosingFetches(Losing):
    """Loses all workers of one task."""

    def is_lost(self, config: RunConfig) -> bool:
        return config.name == "fetch_cup"


def test_an_entry_whose_workers_are_always_lost_does_not_keep_the_others_back(tmp_path: Path) -> None:
    names = {"big": "fetch_cup", "small": "pick_bench"}
    suite = Suite("mine", tuple(SuiteEntry(entry, load_run(task, seed=4), 6) for entry, task in names.items()))
    with Evaluation(suite, tmp_path) as evaluation:
        document = evaluation.run(LosingFetches())
    assert [entry["episodes"] for entry in document["entries"]] == [0, 6]
    assert document["interrupted"]
    assert document["notes"][0] == "big: no result for seeds 4 to 9 after 3 runs: killed"
    with Evaluation(suite, tmp_path) as evaluation:
        document = evaluation.run(LosingFetches())
    assert document["notes"][0].startswith("no episode has ended, each one lost its worker: killed; what has finished")
    assert document["notes"][1] == "big: no result for seeds 4 to 6 after 3 runs: killed"


def test_further_rounds_are_planned_for_the_entries_without_lost_seeds(tmp_path: Path) -> None:
    names = {"big": "fetch_cup", "small": "pick_bench"}
    entries = tuple(SuiteEntry(entry, load_run(task, seed=4), 60) for entry, task in names.items())
    suite = Suite("mine", entries, precision=Precision(0.1))

    class LosingOne(LosingFetches):
        def is_lost(self, config: RunConfig) -> bool:
            return super().is_lost(config) and config.seed == self.LOST

    for _ in range(2):
        with Evaluation(suite, tmp_path) as evaluation:
            document = evaluation.run(LosingOne())
        assert [entry["episodes"] for entry in document["entries"]] == [15, 60]
        assert [entry["missing"] for entry in document["entries"]] == [[5], []]
        assert document["interrupted"]
    mended = Losing()
    mended.LOST = 0
    with Evaluation(suite, tmp_path) as evaluation:
        assert [entry["episodes"] for entry in evaluation.run(mended)["entries"]] == [60, 60]


def test_a_launcher_that_leaves_episodes_out_ends_the_evaluation(tmp_path: Path) -> None:
    class Lazy(LocalProcesses):
        def results(self) -> Iterator[tuple[int, RunResult]]:
            yield 0, result(4)

    suite = Suite("mine", (SuiteEntry("one", load_run("fetch_cup", seed=4), 3),))
    with Evaluation(suite, tmp_path) as evaluation:
        document = evaluation.run(Lazy())
    assert document["interrupted"]
    assert document["notes"] == ["one: no result for seeds 5 to 6 by the launcher"]


def test_a_result_that_a_launcher_yields_twice_counts_once(tmp_path: Path) -> None:
    class Twice(LocalProcesses):
        def results(self) -> Iterator[tuple[int, RunResult]]:
            while self._waiting:
                place = self._waiting.popleft()
                for sim_time in (40.0, 99.0):
                    yield place, replace(result(self.requests[place].config.seed), sim_time_s=sim_time)

    suite = Suite("mine", (SuiteEntry("one", load_run("fetch_cup", seed=4), 2),))
    with Evaluation(suite, tmp_path) as evaluation:
        document = evaluation.run(Twice())
    assert (document["episodes"], document["entries"][0]["sim_time_s"]) == (2, 80.0)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) == 2


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_a_place_that_takes_no_files_ends_the_evaluation_and_is_no_result(
    request_of_one: EpisodeRequest, tmp_path: Path, jobs: int
) -> None:
    (tmp_path / "full").write_text("")
    launcher = LocalProcesses(LaunchOptions(jobs))
    launcher.submit([replace(request_of_one, folder=tmp_path / "full" / "runs")])
    with pytest.raises(LauncherLostError, match=r"cannot write the files of an episode: .* once they can be written$"):
        list(launcher.results())
    launcher.cancel()


def full(*_: object, **__: object) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_full_disk_ends_the_evaluation_until_there_is_room(
    request_of_one: EpisodeRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = replace(request_of_one, folder=tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("bestman_bt.evaluation.run_folder.make_folder", full)
        with pytest.raises(LauncherLostError, match=r"No space left on device; .* once there is room$"):
            asked.run()
    monkeypatch.setattr(launcher_module, "prepare_episode", full)
    monkeypatch.setattr(launcher_module.shutil, "disk_usage", lambda _: SimpleNamespace(free=4096))
    with pytest.raises(LauncherLostError, match=r"No space left on device; .* once there is room$"):
        asked.run()


def test_a_full_disk_for_temporary_files_costs_a_worker(
    request_of_one: EpisodeRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_process, "UNPACKING", 0.0)
    with monkeypatch.context() as patch:
        patch.setattr(worker_process, "TemporaryDirectory", full)
        answer = worker_process.run_in_own_process(request_of_one.pickled(), 60.0, str(tmp_path))
    why = f"no worker starts on {platform.node()}: No space left on device"
    assert answer == EpisodeAnswer(lost=why, by_machine=True)


@pytest.mark.parametrize("is_saved", [True, False])
def test_an_episode_without_inotify_or_shared_memory_is_an_error_where_the_disk_has_room(
    request_of_one: EpisodeRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_saved: bool
) -> None:
    monkeypatch.setattr(launcher_module, "prepare_episode", full)
    got = replace(request_of_one, folder=tmp_path if is_saved else None).run()
    assert got.failure is not None
    assert got.outcome is Outcome.ERROR
    assert "No space left on device" in got.failure.why
