"""Datasets that collections share, resume and cannot write; the episodes are made up, so nothing is simulated."""

from __future__ import annotations

import errno
import json
import resource
from collections.abc import Callable, Iterator
from collections.abc import Collection as Several
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow
import pyarrow.parquet as parquet
import pytest

from behaviours.failure import NodeFailure
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.evaluation.collection import ATTEMPTS, STAGED, Collection
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import EpisodeAnswer, LauncherLostError
from bestman_bt.evaluation.recorded_episode import ACTION, LABELS, NODE, STATE, RecordedEpisode, labels
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetError, DatasetFolder
from bestman_bt.manipulation.policy.training.lerobot_dataset import DatasetWriter

SEED = 4100


class KilledError(BaseException):
    """Ends the collection as a signal would."""


class MadeUp(LocalProcesses):
    """Stages episodes of one frame; those of ``broken`` seeds end in an error, of ``failing`` ones in a failure."""

    def __init__(self, broken: Several[int] = (), failing: Several[int] = ()) -> None:
        super().__init__()
        self.broken, self.failing = broken, failing
        self.ran: list[int] = []

    def results(self) -> Iterator[tuple[int, RunResult]]:
        while self._waiting:
            place = self._waiting.popleft()
            request = self.requests[place]
            assert isinstance(request, RecordedEpisode)
            self.ran.append(request.config.seed)
            yield place, self.result(request)

    def result(self, request: RecordedEpisode) -> RunResult:
        result, seed = request.failed_result("a plug-in has a fault"), request.config.seed
        if seed in self.broken:
            return result
        if seed in self.failing:
            result = replace(result, outcome=Outcome.FAILURE, failure=NodeFailure("pick/Grasp::3", "missed", "empty"))
            return staged(request, result, **labels(result)) if request.failures else result
        return staged(request, replace(result, success=True, outcome=Outcome.SUCCESS, failure=None))


def staged(request: RecordedEpisode, result: RunResult, **about: str) -> RunResult:
    writer = DatasetWriter(request.staged / str(request.config.seed), request.frames)
    zeros = [0.0] * len(request.frames.numbers[STATE])
    writer.add_frame({STATE: zeros, ACTION: zeros, NODE: ""}, {})
    writer.end_episode(request.words, seed=request.config.seed, run="", audit="{}", **about)
    return result


@pytest.fixture(scope="module")
def config() -> RunConfig:
    return load_run("pick_bench", seed=SEED)


def collect(
    config: RunConfig,
    folder: Path,
    launcher: LocalProcesses,
    episodes: int = 2,
    words: str = "pick",
    failures: bool = True,
) -> Collection:
    collection = Collection(config, folder, words, (), failures=failures)
    collection.collect(episodes, 4, lambda result: None, launcher)
    return collection


def contents(folder: Path) -> dict[str, bytes]:
    found = (path for path in folder.rglob("*") if path.is_file() and path.name != ATTEMPTS)
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def attempts(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / ATTEMPTS).read_text().splitlines()]


def test_a_collect_that_was_killed_before_its_first_success_goes_on(config: RunConfig, tmp_path: Path) -> None:
    left: dict[str, bool] = {}

    class Killed(MadeUp):
        def result(self, request: RecordedEpisode) -> RunResult:
            for path in (tmp_path / "set").rglob("*"):
                left[str(path.relative_to(tmp_path))] = path.is_dir()
            raise KilledError

    with pytest.raises(KilledError):
        collect(config, tmp_path / "set", Killed())
    assert not (tmp_path / "set").exists()
    for name, is_folder in left.items():  # a signal leaves what was there
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).mkdir(exist_ok=True) if is_folder else (tmp_path / name).touch()
    assert (tmp_path / "set" / STAGED).exists()
    assert collect(config, tmp_path / "set", MadeUp()).kept == 2
    assert not (tmp_path / "set" / STAGED).exists()


def test_what_a_launcher_leaves_does_not_keep_the_next_collect_out(config: RunConfig, tmp_path: Path) -> None:
    class Slurm(MadeUp):
        def result(self, request: RecordedEpisode) -> RunResult:
            (tmp_path / "set" / "slurm").mkdir()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect(config, tmp_path / "set", Slurm())
    assert (tmp_path / "set" / "slurm").is_dir()
    assert collect(config, tmp_path / "set", MadeUp()).kept == 2


@pytest.mark.parametrize("failures", [True, False], ids=["failures", "no failures"])
def test_seeds_that_ended_in_an_error_are_run_again_but_other_failures_are_not(
    config: RunConfig, tmp_path: Path, failures: bool
) -> None:
    everything = range(SEED, SEED + 4)
    assert collect(config, tmp_path, MadeUp(broken=everything), failures=failures).kept == 0
    mended = MadeUp(failing=[SEED])
    assert collect(config, tmp_path, mended, episodes=1, failures=failures).kept == 1
    assert mended.ran == [SEED, SEED + 1]
    again = MadeUp()
    assert collect(config, tmp_path, again, failures=failures).kept == 2
    assert again.ran == [SEED + 2]
    outcomes = ["error"] * 4 + ["failure", "success", "success"]
    assert [one["outcome"] for one in attempts(tmp_path)] == outcomes


def test_episodes_are_kept_in_the_order_of_their_seeds_and_not_of_their_ends(config: RunConfig, tmp_path: Path) -> None:
    class Backwards(MadeUp):
        def results(self) -> Iterator[tuple[int, RunResult]]:
            self._waiting.reverse()
            return super().results()

    shown: list[int] = []
    launcher = Backwards(failing=[SEED + 1])
    Collection(config, tmp_path, "pick", ()).collect(3, 9, lambda result: shown.append(result.seed), launcher)
    assert launcher.ran == [SEED + 2, SEED + 1, SEED, SEED + 3]
    assert shown == [SEED, SEED + 1, SEED + 2, SEED + 3]
    assert [row["seed"] for row in DatasetFolder.read(tmp_path).episodes] == [SEED, SEED + 2, SEED + 3]
    assert [(one["seed"], one["episode"], one["outcome"]) for one in attempts(tmp_path)] == [
        (SEED, 0, "success"),
        (SEED + 1, 0, "failure"),
        (SEED + 2, 1, "success"),
        (SEED + 3, 2, "success"),
    ]


def test_failed_episodes_are_a_dataset_of_their_own_that_says_why_they_failed(
    config: RunConfig, tmp_path: Path
) -> None:
    collection = collect(config, tmp_path, MadeUp(broken=[SEED], failing=[SEED + 1, SEED + 3]))
    assert (collection.kept, collection.failures) == (1, 2)
    assert [row["seed"] for row in DatasetFolder.read(tmp_path).episodes] == [SEED + 2]
    apart = DatasetFolder.read(tmp_path / FAILURES)
    assert [row["seed"] for row in apart.episodes] == [SEED + 1, SEED + 3]
    assert len(apart.data(1)[STATE]) == 1
    why = {"outcome": "failure", "error_code": "missed", "failed_node": "pick/Grasp::3", "why": "empty"}
    for record in (*apart.episodes, attempts(tmp_path)[1]):
        assert {name: record[name] for name in LABELS} == why


def test_without_failures_their_frames_are_not_kept_and_their_seeds_not_run_for_them_later(
    config: RunConfig, tmp_path: Path
) -> None:
    assert collect(config, tmp_path, MadeUp(failing=[SEED]), episodes=1, failures=False).kept == 1
    assert not (tmp_path / FAILURES).exists()
    assert (attempts(tmp_path)[0]["episode"], attempts(tmp_path)[0]["error_code"]) == (None, "missed")
    later = MadeUp(failing=[SEED, SEED + 2])
    collection = collect(config, tmp_path, later)
    assert later.ran == [SEED + 2, SEED + 3]
    assert (collection.kept, collection.failures) == (2, 1)


@pytest.mark.parametrize("failures", [True, False], ids=["failures", "no failures"])
def test_a_failed_episode_that_a_killed_process_has_not_listed_is_listed_with_its_reason(
    config: RunConfig, tmp_path: Path, failures: bool
) -> None:
    collect(config, tmp_path, MadeUp(failing=[SEED]), episodes=1)
    before = attempts(tmp_path)
    (tmp_path / ATTEMPTS).write_text("")
    launcher = MadeUp()
    collection = collect(config, tmp_path, launcher, failures=failures)
    assert launcher.ran == [SEED + 2]
    assert (collection.kept, collection.failures) == (2, 1)
    success, failure, _ = attempts(tmp_path)
    assert [{**success, "versions": {}}, {**failure, "versions": {}}] == [
        {**one, "versions": {}} for one in before[::-1]
    ]


def test_a_success_that_is_not_the_robots_is_listed_with_its_reason_and_not_kept(
    config: RunConfig, tmp_path: Path
) -> None:
    class HeldBefore(MadeUp):
        def result(self, request: RecordedEpisode) -> RunResult:
            result = super().result(request)
            return replace(result, held_at_start=True) if request.config.seed == SEED else result

    assert collect(config, tmp_path, HeldBefore()).kept == 2
    assert [row["seed"] for row in DatasetFolder.read(tmp_path).episodes] == [SEED + 1, SEED + 2]
    assert attempts(tmp_path)[0]["why"] == "the goal held before the run began"
    assert attempts(tmp_path)[0]["episode"] is None


def test_a_seed_whose_workers_are_lost_is_listed_keeps_none_back_and_is_run_again(
    config: RunConfig, tmp_path: Path
) -> None:
    class Losing(MadeUp):
        def results(self) -> Iterator[tuple[int, RunResult]]:
            for place, result in super().results():
                if place == 1:
                    self.given_up[place] = "killed"
                else:
                    yield place, result

    collection = Collection(config, tmp_path, "pick", ())
    lost = collection.collect(2, 3, lambda result: None, Losing())
    again = "a later command runs them again if the dataset lacks episodes"
    assert lost == [f"pick_bench: no result for seed {SEED + 1} after 3 runs: killed; {again}"]
    assert [row["seed"] for row in DatasetFolder.read(tmp_path).episodes] == [SEED, SEED + 2]
    listed = [(one["seed"], one["outcome"], one["why"]) for one in attempts(tmp_path)]
    assert listed == [(SEED, "success", ""), (SEED + 1, "error", "killed"), (SEED + 2, "success", "")]
    again = MadeUp()
    assert collect(config, tmp_path, again, episodes=4).kept == 4
    assert again.ran == [SEED + 1, SEED + 3]


def test_a_first_round_whose_workers_are_all_lost_is_listed_and_run_again_by_the_next_command(
    config: RunConfig, tmp_path: Path
) -> None:
    class Losing(MadeUp):
        def results(self) -> Iterator[tuple[int, RunResult]]:
            while self._waiting:
                place = self._waiting.popleft()
                self.take(place, EpisodeAnswer(lost="killed"))
                if place not in self.given_up:
                    self._waiting.append(place)
            yield from ()

    with pytest.raises(LauncherLostError, match="^no episode has ended, each one lost its worker: killed"):
        collect(config, tmp_path, Losing(), episodes=4)
    assert [(one["seed"], one["why"]) for one in attempts(tmp_path)] == [(SEED + n, "killed") for n in range(3)]
    again = MadeUp()
    assert collect(config, tmp_path, again, episodes=4).kept == 4
    assert again.ran == list(range(SEED, SEED + 4))


def test_another_task_in_the_folder_counts_for_itself(config: RunConfig, tmp_path: Path) -> None:
    assert collect(config, tmp_path, MadeUp()).kept == 2
    other = MadeUp()
    assert collect(config, tmp_path, other, words="place").kept == 2
    assert other.ran == [SEED, SEED + 1]
    assert [row["tasks"] for row in DatasetFolder.read(tmp_path).episodes] == [["pick"]] * 2 + [["place"]] * 2


def test_a_dataset_that_is_being_written_is_refused_and_left_alone(config: RunConfig, tmp_path: Path) -> None:
    class Shared(MadeUp):
        def result(self, request: RecordedEpisode) -> RunResult:
            result = super().result(request)
            with pytest.raises(ConfigurationError, match="another collect is writing it"):
                collect(config, tmp_path, MadeUp())
            return result

    assert collect(config, tmp_path, Shared()).kept == 2


def test_what_another_collect_has_added_since_counts(config: RunConfig, tmp_path: Path) -> None:
    early, launcher = Collection(config, tmp_path, "pick", ()), MadeUp()
    collect(config, tmp_path, MadeUp(), episodes=1)
    early.collect(2, 4, lambda result: None, launcher)
    assert launcher.ran == [SEED + 1]
    assert [row["seed"] for row in DatasetFolder.read(tmp_path).episodes] == [SEED, SEED + 1]


def test_workers_of_an_earlier_call_stage_nothing_for_a_later_one(config: RunConfig, tmp_path: Path) -> None:
    first, second = MadeUp(), MadeUp()
    collect(config, tmp_path, first, episodes=1)
    collect(config, tmp_path, second, episodes=2)
    (old,), (new,) = first.requests, second.requests
    assert isinstance(old, RecordedEpisode)
    assert isinstance(new, RecordedEpisode)
    assert old.staged != new.staged
    assert tmp_path in old.staged.parents


@pytest.mark.parametrize("torn", ["", '{"task": "pi'])
def test_a_killed_process_may_leave_a_torn_line_or_an_episode_without_one(
    config: RunConfig, tmp_path: Path, torn: str
) -> None:
    collect(config, tmp_path, MadeUp(), episodes=2)
    (first, second) = (tmp_path / ATTEMPTS).read_text().splitlines(keepends=True)
    (tmp_path / ATTEMPTS).write_text(first + torn)
    launcher = MadeUp()
    assert collect(config, tmp_path, launcher, episodes=3).kept == 3
    assert launcher.ran == [SEED + 2]
    listed = [(one["seed"], one["episode"], one["outcome"]) for one in attempts(tmp_path)]
    assert listed == [(SEED + number, number, "success") for number in range(3)]
    assert json.loads(second)["seed"] == SEED + 1


def test_a_damaged_list_of_attempts_is_named(config: RunConfig, tmp_path: Path) -> None:
    collect(config, tmp_path, MadeUp(), episodes=1)
    with (tmp_path / ATTEMPTS).open("ab") as file:
        file.write(b'\xff\n{"task": "a", "seed": 1}\n')
    with pytest.raises(ConfigurationError) as refused:
        collect(config, tmp_path, MadeUp(), episodes=2)
    assert [problem.line for problem in refused.value.problems] == [2, 3]
    assert "is damaged: remove the line; its seed is run again" in str(refused.value)


def test_a_full_disk_is_reported_and_what_was_written_before_is_kept(
    config: RunConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    collection = collect(config, tmp_path, MadeUp(), episodes=1)
    write_table = parquet.write_table

    def full(table: Any, path: Path) -> None:
        if STAGED not in Path(path).parts and "episodes" in Path(path).parts:
            raise OSError(errno.ENOSPC, "No space left on device")
        write_table(table, path)

    with monkeypatch.context() as patch:
        patch.setattr(parquet, "write_table", full)
        with pytest.raises(DatasetError, match=r"No space left on device; the 1 episodes in it are kept"):
            collection.collect(2, 4, lambda result: None, MadeUp())
    assert collection.kept == 1
    assert collect(config, tmp_path, MadeUp()).kept == 2


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("failing", [[SEED], []], ids=["failure", "success"])
@pytest.mark.parametrize("moves", [3, 2, 0, 1, 4])
def test_a_process_that_is_killed_while_it_writes_an_episode_loses_and_doubles_nothing(
    config: RunConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moves: int, failing: list[int]
) -> None:
    whole, torn = tmp_path / "whole", tmp_path / "torn"
    collect(config, whole, MadeUp(failing=failing))
    left = moves

    def until_killed(move: Callable[[Path, Path], Path]) -> Callable[[Path, Path], Path]:
        def moved(path: Path, target: Path) -> Path:
            nonlocal left
            if torn in path.parents and STAGED not in path.parts:
                if left == 0:
                    raise KilledError
                left -= 1
            return move(path, target)

        return moved

    with monkeypatch.context() as patch:
        for name in ("rename", "replace"):
            patch.setattr(Path, name, until_killed(getattr(Path, name)))
        with pytest.raises(KilledError):
            collect(config, torn, MadeUp(failing=failing))
    assert collect(config, torn, MadeUp(failing=failing)).kept == 2
    assert contents(torn) == contents(whole)
    listed = [{**one, "versions": {}} for one in attempts(torn)]
    assert listed == [{**one, "versions": {}} for one in attempts(whole)]


def test_a_list_of_attempts_that_cannot_be_written_is_told(config: RunConfig, tmp_path: Path) -> None:
    class Limited(MadeUp):
        def result(self, request: RecordedEpisode) -> RunResult:
            resource.setrlimit(resource.RLIMIT_FSIZE, (20, before[1]))
            return super().result(request)

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with pytest.raises(DatasetError, match=r"can no longer be written: .*File too large"):
            collect(config, tmp_path, Limited(broken=[SEED]))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert collect(config, tmp_path, MadeUp()).kept == 2


def test_a_dataset_of_the_same_features_that_collect_has_not_written_is_refused_before_anything_runs(
    config: RunConfig, tmp_path: Path
) -> None:
    collect(config, tmp_path, MadeUp(), episodes=1)
    rows = tmp_path / "meta/episodes/chunk-000/file-000.parquet"
    others = [
        {key: value for key, value in row.items() if key not in ("run", "audit")}
        for row in parquet.read_table(rows).to_pylist()
    ]
    parquet.write_table(pyarrow.Table.from_pylist(others), rows)
    with pytest.raises(
        DatasetError,
        match=f"^{tmp_path} was written by another version of collect, or not by it: .* lack audit, run; name another",
    ):
        Collection(config, tmp_path, "pick", ())


def test_successes_where_the_failures_belong_are_refused_before_anything_runs(
    config: RunConfig, tmp_path: Path
) -> None:
    collect(config, tmp_path / FAILURES, MadeUp(), episodes=1)
    (tmp_path / ATTEMPTS).touch()
    with pytest.raises(
        DatasetError, match="failures was written by another version of collect, or .* lack error_code, failed"
    ):
        Collection(config, tmp_path, "pick", ())
