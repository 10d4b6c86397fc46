"""Datasets of judged successes: what ``bestman-bt collect`` keeps, resumes and refuses."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet as parquet
import pytest

from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.audit import CHEATS
from bestman_bt.evaluation.collection import ATTEMPTS, Collection
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, LaunchOptions
from bestman_bt.evaluation.launchers.local import LocalProcesses
from bestman_bt.evaluation.launchers.worker_process import LauncherLostError
from bestman_bt.evaluation.recorded_episode import LABELS, RecordedEpisode
from bestman_bt.evaluation.result import RunResult
from bestman_bt.manipulation.policy.training.dataset_folder import FAILURES, DatasetError, DatasetFolder
from tests.cli.command_line import Answer

Command = Callable[..., Answer]
SEED = 4100


def attempts(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / ATTEMPTS).read_text().splitlines()]


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("collected") / "picks"
    config = load_run("pick_bench", seed=SEED)
    collection = Collection(config, folder, config.task.description, (), subtasks=True)
    collection.collect(1, 1, lambda result: None)
    assert collection.kept == 1
    return folder


@pytest.mark.slow
def test_a_judged_success_is_kept_with_what_was_measured_commanded_and_ticked(collected: Path) -> None:
    info = json.loads((collected / "meta/info.json").read_text())
    table = parquet.read_table(collected / "data/chunk-000/file-000.parquet").to_pydict()
    state, action = np.array(table["observation.state"]), np.array(table["action"])
    names = info["features"]["observation.state"]["names"]
    assert len(state) == info["total_frames"] > 100
    width = names.index("gripper/width")
    assert np.ptp(state[:, width]) > 0.02
    arm = [index for index, name in enumerate(names) if name.startswith("arm/")]
    assert np.ptp(state[:, arm], axis=0).max() > 0.5
    lag = np.abs(action[:-1, arm] - state[1:, arm]).max()  # a tick later the joints are where they were sent
    assert 0.0 < lag < 0.1
    assert any("Grasp" in node for node in table["node"])
    spans = table["language_persistent"][0]
    assert all(frame == spans for frame in table["language_persistent"])
    (grasp,) = (span for span in spans if span["content"] == "grasp (object cup)")
    began = table["timestamp"].index(grasp["timestamp"])
    assert ("/Grasp::" in table["node"][began - 1], "/Grasp::" in table["node"][began]) == (False, True)
    assert [span["timestamp"] for span in spans] == sorted({span["timestamp"] for span in spans})
    assert [(one["outcome"], one["episode"]) for one in attempts(collected)][-1] == ("success", 0)
    (row,) = parquet.read_table(collected / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert (row["seed"], row["tasks"]) == (SEED, [load_run("pick_bench").task.description])
    audit = json.loads(row["audit"])
    assert not any(audit[cheat] for cheat in CHEATS)
    assert audit["disturbances"] == []


@pytest.mark.slow
def test_a_second_call_runs_nothing_that_has_ended_and_a_failure_is_kept_apart(
    collected: Path, bestman_bt: Command
) -> None:
    before = attempts(collected)
    again = ("collect", "pick_bench", "-o", collected, "--seed", SEED, "--subtasks", "--format", "lerobot")
    assert bestman_bt(*again, "--episodes", "1").code == 0
    assert attempts(collected) == before
    short = bestman_bt(*again, "--episodes", "2", "--most", "2", "--set", "time_limit=2 s")
    assert short.code == 1
    assert f"1 of 2 episodes, 1 failures in {collected / FAILURES}" in short.out
    (failed,) = attempts(collected)[len(before) :]
    assert (failed["episode"], failed["outcome"]) == (0, "failure")
    assert failed["why"]
    assert json.loads((collected / "meta/info.json").read_text())["total_episodes"] == 1


@pytest.mark.slow
def test_failed_episodes_are_kept_apart_as_they_ran_whatever_runs_them(bestman_bt: Command, folder: Path) -> None:
    def collect(name: str, *options: str) -> dict:
        answer = bestman_bt(
            *("collect", "pick_bench", "-o", name, "--seed", SEED, "--episodes", "2", "--most", "2"),
            *("--words", "pick", "--set", "time_limit=3 s", "--json", *options),
        )
        assert answer.code == 1
        return json.loads(answer.out)

    assert (collect("here")["episodes"], collect("here")["failures"]) == (0, 2)
    collect("processes", "--jobs", "2")
    assert files(folder / "processes") == files(folder / "here")
    assert collect("without", "--no-failures")["failures"] == 0
    assert not (folder / "without" / FAILURES).exists()
    rows = DatasetFolder.read(folder / "here" / FAILURES).episodes
    assert [(row["seed"], row["length"]) for row in rows] == [(SEED, 61), (SEED + 1, 61)]
    assert {row["error_code"] for row in rows} == {"timeout"}
    for row, attempt in zip(rows, attempts(folder / "here"), strict=True):
        assert {name: row[name] for name in LABELS} == {name: attempt[name] for name in LABELS}
    answer = bestman_bt("dataset", "replay", f"here/{FAILURES}", "--json")
    replayed = json.loads(answer.out)
    assert (answer.code, replayed["goal"], replayed["ended_early"]) == (1, False, "")
    assert max(entry["value"] for entry in replayed["difference"].values()) < 0.005
    assert bestman_bt("dataset", "view", f"here/{FAILURES}", "--png", "one.png").code == 0


@pytest.mark.slow
def test_an_episode_replays_open_loop_and_other_actions_do_not_reach_its_goal(
    collected: Path, bestman_bt: Command, tmp_path: Path
) -> None:
    answer = bestman_bt("dataset", "replay", collected, "--json")
    replayed = json.loads(answer.out)
    assert (answer.code, replayed["goal"]) == (0, True)
    assert set(replayed["difference"]) == {"rad", "m"}
    assert max(entry["value"] for entry in replayed["difference"].values()) < 0.005
    shutil.copytree(collected, tmp_path / "still")
    file = tmp_path / "still/data/chunk-000/file-000.parquet"
    table = parquet.read_table(file)
    field = table.schema.field("action")
    first = pyarrow.array(table["action"].slice(0, 1).to_pylist() * len(table), field.type)
    parquet.write_table(table.set_column(table.schema.get_field_index("action"), field, first), file)
    stood = bestman_bt("dataset", "replay", tmp_path / "still")
    assert stood.code == 1
    assert f"episode 0, seed {SEED}: the goal does not hold" in stood.out
    beyond = pyarrow.array([[100.0] * field.type.list_size] * len(table), field.type)
    parquet.write_table(table.set_column(table.schema.get_field_index("action"), field, beyond), file)
    ended = json.loads(bestman_bt("dataset", "replay", tmp_path / "still", "--json").out)
    assert not ended["goal"]
    assert "arm refused" in ended["ended_early"]


class Backwards(LocalProcesses):
    """Runs the last episode first."""

    def results(self) -> Iterator[tuple[int, RunResult]]:
        self._waiting.reverse()
        return super().results()


class LostAfterOne(LocalProcesses):
    """Is lost once an episode has ended."""

    def results(self) -> Iterator[tuple[int, RunResult]]:
        yield next(super().results())
        raise LauncherLostError("the cluster is gone")


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_the_dataset_does_not_depend_on_what_runs_the_episodes_nor_on_interruptions(tmp_path: Path) -> None:
    config = load_run("policy_reach", seed=SEED)

    def collect(name: str, launcher: LocalProcesses) -> None:
        Collection(config, tmp_path / name, "pick", ()).collect(2, 4, lambda result: None, launcher)

    collect("backwards", Backwards())
    with pytest.raises(LauncherLostError):
        collect("interrupted", LostAfterOne())
    assert len(attempts(tmp_path / "interrupted")) == 1
    collect("interrupted", LocalProcesses(LaunchOptions(jobs=2)))
    assert [attempt["seed"] for attempt in attempts(tmp_path / "backwards")][:2] == [SEED, SEED + 1]
    assert files(tmp_path / "interrupted") == files(tmp_path / "backwards")


class Elsewhere(LocalProcesses):
    """A machine that does not see the folder of the dataset."""

    def results(self) -> Iterator[tuple[int, RunResult]]:
        for place, _ in enumerate(self.requests):
            yield place, EpisodeRequest(self.requests[place].config).run()


@pytest.mark.slow
def test_an_episode_that_a_machine_has_written_elsewhere_is_not_taken_for_kept(tmp_path: Path) -> None:
    collection = Collection(load_run("policy_reach", seed=SEED), tmp_path / "set", "pick", ())
    with pytest.raises(LauncherLostError, match="a folder that all machines see under one path"):
        collection.collect(1, 1, lambda result: None, Elsewhere())
    assert not (tmp_path / "set").exists()


class Twice(LocalProcesses):
    """Runs each episode again, as after a worker that was taken to be lost."""

    def results(self) -> Iterator[tuple[int, RunResult]]:
        for place, request in enumerate(self.requests):
            results, folders = [], []
            for _ in range(2):
                results.append(request.run())
                assert isinstance(request, RecordedEpisode)
                folders.append((request.staged / str(request.config.seed)).stat().st_ino)
            assert all(result.success for result in results)
            assert folders[0] == folders[1]  # the driver may be reading it
            yield place, results[0]


@pytest.mark.slow
def test_an_episode_that_two_workers_have_run_is_that_of_the_first(tmp_path: Path) -> None:
    collection = Collection(load_run("policy_reach", seed=SEED), tmp_path / "set", "pick", ())
    collection.collect(1, 1, lambda result: None, Twice())
    assert collection.kept == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("pick_bench", "--camera", "moon"), "'moon' is not a camera of bench_arm"),
        (("pick_bench", "--set", "tick_rate=12.5 Hz"), "should be whole for a dataset, got 12.5 Hz"),
        (
            ("pick_bench", "--set", "predicate=[]"),
            "predicate: should name what judges the episodes of a dataset, got none; known: ",
        ),
        (("no_such_task",), "no_such_task"),
        (("pick_bench", "--launcher", "moon"), "'moon'"),
        (("pick_bench", "--address", "here:1"), "applies only to a cluster; also give its --launcher"),
    ],
)
def test_what_cannot_be_recorded_is_refused_before_anything_starts(
    bestman_bt: Command, folder: Path, arguments: tuple[str, ...], words: str
) -> None:
    answer = bestman_bt("collect", *arguments, "-o", "set")
    assert answer.code == 2
    assert words in answer.err
    assert "nothing was started" in answer.err
    assert not (folder / "set").exists()


def test_a_folder_that_holds_something_else_is_not_written_to(bestman_bt: Command, folder: Path) -> None:
    (folder / "set").mkdir()
    (folder / "set" / "mine.txt").write_text("precious")
    answer = bestman_bt("collect", "pick_bench", "-o", "set")
    assert answer.code == 2
    assert "neither empty nor a dataset" in answer.err
    assert [path.name for path in (folder / "set").iterdir()] == ["mine.txt"]


def test_a_folder_that_cannot_be_made_is_refused_before_anything_starts(bestman_bt: Command, folder: Path) -> None:
    (folder / "file").write_text("precious")
    answer = bestman_bt("collect", "pick_bench", "-o", "file/set")
    assert answer.code == 2
    assert "is not a folder" in answer.err
    answer = bestman_bt("collect", "pick_bench", "-o", "/proc/set")  # root may write there, it seems, but cannot
    assert answer.code == 2
    assert "/proc/set" in answer.err
    assert "episodes" not in answer.out


def test_seeds_without_a_result_are_listed_and_the_exit_code_is_130(
    bestman_bt: Command, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Collection, "collect", lambda *_: ["pick_bench: no result for seed 7"])
    answer = bestman_bt("collect", "pick_bench", "-o", "set", "--json")
    document = json.loads(answer.out)
    assert (answer.code, document["interrupted"], document["notes"]) == (130, "", ["pick_bench: no result for seed 7"])
    assert "no result for seed 7" in answer.err
    assert "waited for an earlier seed" not in answer.err


def test_a_damaged_list_of_attempts_is_wrong_input(bestman_bt: Command, folder: Path) -> None:
    (folder / "set").mkdir()
    (folder / "set" / ATTEMPTS).write_text("not json\n")
    answer = bestman_bt("collect", "pick_bench", "-o", "set", "--json")
    assert answer.code == 2
    assert f"set/{ATTEMPTS}:1: is damaged: remove the line" in answer.err


def test_a_dataset_that_can_no_longer_be_written_is_reported_without_a_traceback(
    bestman_bt: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise DatasetError("set/data cannot be written: No space left on device")

    monkeypatch.setattr(Collection, "collect", full)
    answer = bestman_bt("collect", "pick_bench", "-o", "set", "--json")
    assert answer.code == 130
    document = json.loads(answer.out)
    assert document["interrupted"] == "set/data cannot be written: No space left on device"
    assert document["notes"] == []
    assert "waited for an earlier seed" in answer.err
