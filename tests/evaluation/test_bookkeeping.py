"""What an evaluation makes of episodes that a test has written: seeds, order, what counts, what is met."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from bestman_bt.cli import eval_command
from bestman_bt.configuration.run import RunConfig, load_run
from bestman_bt.evaluation import evaluation as evaluation_module
from bestman_bt.evaluation.episode_measures import DrivenPath, MotionLog
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.interval import Precision
from bestman_bt.evaluation.launchers.launcher import EpisodeRequest, Launcher
from bestman_bt.evaluation.markdown import markdown
from bestman_bt.evaluation.result import Outcome, RunResult
from bestman_bt.evaluation.suite import EntryConfig, Successes, Suite, SuiteEntry
from bestman_bt.messages import Pose, Pose2D
from bestman_bt.visualization.motion_file import read_motion
from hal.simulation.scene_recorder import SceneSnapshot
from tests.evaluation.test_summary import result

Episode = Callable[[RunConfig], RunResult]


def succeed(config: RunConfig) -> RunResult:
    return result(config.seed)


def pretend(claims: RunConfig) -> RunResult:
    """The tree claims success, the judge denies it."""
    return result(claims.seed, predicate=False)


def fail(config: RunConfig) -> RunResult:
    return result(config.seed, tree="FAILURE", predicate=False)


def cancel(config: RunConfig) -> RunResult:
    return replace(result(config.seed, tree="IDLE", predicate=None), outcome=Outcome.CANCELLED)


class Episodes(Launcher):
    """Runs nothing: ``of`` makes the results. ``ran``: task and seed of each, in their order.

    ``backwards``: the last comes first.
    """

    def __init__(self, *of: Episode, backwards: bool = False) -> None:
        super().__init__()
        self._next = -1 if backwards else 0
        self._of, self.ran, self.waiting = list(of), [], []

    def submit(self, requests: Sequence[EpisodeRequest]) -> None:
        self.waiting += enumerate(requests, len(self.requests))
        self.requests += requests

    def results(self) -> Iterator[tuple[int, RunResult]]:
        while self.waiting:
            place, request = self.waiting.pop(self._next)
            make = self._of.pop(0) if len(self._of) > 1 else self._of[0]
            self.ran.append((request.config.name, request.config.seed))
            yield place, make(request.config)

    def cancel(self) -> None:
        self.waiting.clear()
        self.requests.clear()


@pytest.fixture
def episodes(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Episodes]:
    def scripted(*of: Episode, backwards: bool = False) -> Episodes:
        made = Episodes(*of, backwards=backwards)
        monkeypatch.setattr(evaluation_module, "LocalProcesses", lambda: made)
        return made

    monkeypatch.setattr(evaluation_module, "code_fingerprint", lambda: "code")
    monkeypatch.setattr(evaluation_module, "commit", lambda: "1234")
    return scripted


def suite(*successes: Successes | None, settings: tuple[str, ...] = ()) -> Suite:
    """Entries of three episodes each, from seed 5 on; the second and later ones are controls."""
    entries = []
    for number, asked in enumerate(successes):
        config = load_run("fetch_cup", seed=5, settings=(f"time_limit={10 + number} s", *settings))
        wanted = None if asked is None else EntryConfig(asked)
        entries.append(SuiteEntry(f"entry{number}", config, 3, wanted, number > 0))
    return Suite("mine", tuple(entries))


def evaluated(of: Suite, folder: Path | None = None, **options: Any) -> dict[str, Any]:
    with Evaluation(of, folder, **options) as evaluation:
        return evaluation.run()


ALL, NONE = Successes(3, at_least=3), Successes(3, at_most=0)


def test_every_seed_of_every_entry_is_run_and_reported_with_its_entry(episodes: Callable[..., Episodes]) -> None:
    episodes(succeed, succeed, succeed, pretend)
    told = []
    with Evaluation(suite(ALL, NONE)) as evaluation:
        document = evaluation.run(on_result=lambda entry, result: told.append((entry.name, result.seed)))
    assert told == [(name, seed) for name in ("entry0", "entry1") for seed in (5, 6, 7)]
    task, control = document["entries"]
    assert (task["succeeded"], task["met"], control["succeeded"], control["false_successes"]) == (3, True, 0, 3)
    assert (document["episodes"], document["false_successes"], document["interrupted"]) == (6, 3, False)
    assert (document["met"], document["code"], document["commit"]) == (False, "code", "1234")


class Repeating(Episodes):
    """Yields each result twice."""

    def results(self) -> Iterator[tuple[int, RunResult]]:
        for place, made in super().results():
            yield place, made
            yield place, made


def test_a_result_that_a_launcher_yields_twice_counts_once(tmp_path: Path) -> None:
    told = []
    with Evaluation(suite(ALL), tmp_path) as evaluation:
        document = evaluation.run(Repeating(succeed), lambda entry, result: told.append(result.seed))
    assert told == [5, 6, 7]
    assert (document["episodes"], document["entries"][0]["succeeded"], document["met"]) == (3, 3, True)
    assert len((tmp_path / "episodes.jsonl").read_text().splitlines()) == 3


def test_results_that_come_in_another_order_are_those_of_their_seeds(episodes: Callable[..., Episodes]) -> None:
    episodes(pretend, succeed, backwards=True)
    document = evaluated(suite(ALL))
    (entry,) = document["entries"]
    assert [failure["seed"] for failure in entry["failures"]] == [7]


@pytest.mark.parametrize(
    ("asked", "of", "met"),
    [
        (ALL, (succeed,), True),
        (ALL, (succeed, succeed, pretend), False),
        (Successes(3, at_least=1), (succeed, cancel), False),  # not all were run
        (None, (succeed,), True),
        (None, (succeed, pretend), False),
    ],
)
def test_an_entry_is_met_where_all_its_episodes_are_run_and_come_out_as_asked(
    episodes: Callable[..., Episodes], asked: Successes | None, of: tuple[Episode, ...], met: bool
) -> None:
    episodes(*of)
    document = evaluated(suite(asked))
    assert document["entries"][0]["met"] is met
    assert document["met"] is met


@pytest.mark.parametrize(
    ("asked", "of", "words", "cell"),
    [
        (EntryConfig(), fail, "No targets.", "none asked"),
        (EntryConfig(), pretend, "Not all targets met.", "missed: false successes 3, asked 0"),
        (EntryConfig(ALL), succeed, "All targets met.", "met"),
        (EntryConfig(ALL), fail, "Not all targets met.", "missed: successes 0 of 3, asked ≥ 3 of 3"),
        (None, succeed, "All episodes succeeded.", "none asked"),
        (None, fail, "Not all episodes succeeded.", "none asked"),
    ],
)
def test_targets_are_reported_as_met_only_where_some_were_set(
    episodes: Callable[..., Episodes], asked: EntryConfig | None, of: Episode, words: str, cell: str
) -> None:
    episodes(of)
    entry = replace(suite(None).entries[0], asked=asked)
    page = markdown(evaluated(Suite("mine", (entry,))))
    assert f"**{words}**" in page
    assert f"| {cell} |" in page


def test_with_a_precision_rounds_end_where_it_is_reached_also_after_an_interruption(
    episodes: Callable[..., Episodes], tmp_path: Path
) -> None:
    def every_eighth_fails(config: RunConfig) -> RunResult:
        return (succeed if config.seed % 8 else fail)(config)

    entries = [replace(entry, episodes=200) for entry in suite(ALL).entries]
    asked = Suite("mine", tuple(entries), precision=Precision(0.1))
    episodes(every_eighth_fails)
    whole = evaluated(asked, tmp_path / "whole")
    (entry,) = whole["entries"]
    low, high = entry["interval"]
    assert high - low <= 0.2
    assert 17 < entry["episodes"] == entry["asked_episodes"] < 60
    assert (whole["until"], entry["missing"]) == ("95%±10", [])
    episodes(*20 * [every_eighth_fails], cancel)
    assert evaluated(asked, tmp_path / "twice")["interrupted"]
    again = episodes(every_eighth_fails)
    assert evaluated(asked, tmp_path / "twice")["entries"] == whole["entries"]
    assert len(again.ran) == entry["episodes"] - 20
    episodes(succeed)
    capped = Suite("mine", tuple(replace(entry, episodes=9) for entry in entries), precision=Precision(0.1))
    assert evaluated(capped)["episodes"] == 9


def test_one_entry_that_is_not_clean_makes_the_whole_evaluation_unclean(episodes: Callable[..., Episodes]) -> None:
    episodes(lambda config: result(config.seed, teleports=int(config.seed == 6)))
    document = evaluated(suite(ALL, ALL))
    assert document["audit_clean"] is False
    assert document["entries"][0]["unclean_seeds"] == [6]
    assert document["met"] is False


def test_a_stopped_episode_ends_it_counts_for_nothing_and_is_the_next_one_to_be_run(
    episodes: Callable[..., Episodes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    episodes(succeed, cancel)
    document = evaluated(suite(ALL, NONE), tmp_path)
    assert (document["interrupted"], document["episodes"], document["met"]) == (True, 1, False)
    eval_command.print_result({**document, "comparisons": []})
    told = capsys.readouterr().out
    assert ": interrupted, 1 of 6 episodes completed; " in told
    assert ": 1 of 1 succeeded" in told
    assert ": none of 3 episodes was completed" in told
    again = episodes(succeed)
    document = evaluated(suite(ALL, NONE), tmp_path)
    assert [seed for _, seed in again.ran] == [6, 7, 5, 6, 7]
    assert (document["interrupted"], document["episodes"]) == (False, 6)


def test_episodes_of_other_code_count_only_where_that_is_asked_and_those_of_another_configuration_never(
    episodes: Callable[..., Episodes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes(succeed)
    evaluated(suite(ALL), tmp_path)
    same = episodes(pretend)
    assert evaluated(suite(ALL), tmp_path)["met"] is True
    assert same.ran == []
    other = episodes(pretend)
    assert evaluated(suite(ALL, settings=("tick_rate=10 Hz",)), tmp_path, keep_old=True)["entries"][0]["succeeded"] == 0
    assert len(other.ran) == 3
    monkeypatch.setattr(evaluation_module, "code_fingerprint", lambda: "newer")
    old = episodes(pretend)
    document = evaluated(suite(ALL), tmp_path, keep_old=True)
    assert (old.ran, document["met"]) == ([], True)
    assert document["notes"] == ["3 finished episodes were run with other code and count all the same"]
    assert evaluated(suite(ALL), tmp_path)["entries"][0]["succeeded"] == 0
    assert len(old.ran) == 3


def test_code_that_changes_while_it_runs_is_reported(
    episodes: Callable[..., Episodes], monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes(succeed)
    versions = iter(["before", "after"])
    monkeypatch.setattr(evaluation_module, "code_fingerprint", lambda: next(versions))
    (note,) = evaluated(suite(ALL))["notes"]
    assert "the code was changed while the evaluation ran" in note


def test_an_entry_without_successes_may_fail_but_not_claim_what_is_not_so(episodes: Callable[..., Episodes]) -> None:
    of = suite(ALL)
    (entry,) = of.entries
    of = replace(of, entries=(replace(entry, asked=EntryConfig(settings=("time_limit=10 s",))),))
    episodes(succeed, fail)
    (document,) = evaluated(of)["entries"]
    assert (document["succeeded"], document["met"], document["settings"]) == (1, True, {"time_limit": "10 s"})
    assert "- entry0: `time_limit=10 s`" in markdown(evaluated(of))
    episodes(succeed, pretend)
    assert not evaluated(of)["met"]


def test_the_way_that_a_base_has_driven_is_added_up_from_tick_to_tick_and_a_turn_is_none() -> None:
    poses = iter([Pose2D(5.0, 5.0, 0.0), Pose2D(5.0, 5.3, 1.0), Pose2D(5.0, 5.3, -2.0), Pose2D(5.4, 5.0, -2.0)])
    truth: Any = SimpleNamespace(base_pose=lambda: next(poses).to_pose())
    driven = DrivenPath(truth)
    lengths = []
    for _ in range(4):
        driven.after_tick()
        lengths.append(driven.length)
    assert lengths == pytest.approx([0.0, 0.3, 0.3, 0.8])


def test_a_motion_holds_its_first_and_last_moment_and_every_fourth_tick_between(tmp_path: Path) -> None:
    stamps = iter(range(100))

    def seen() -> SceneSnapshot:
        stamp = next(stamps)
        pose = Pose2D(float(stamp), 0.0, 0.0).to_pose()
        return SceneSnapshot(float(stamp), pose, {}, {"cup": pose}, {"chest/door": Pose()}, {"walker": Pose()})

    log = MotionLog(tmp_path, SimpleNamespace(scene_snapshot=seen))
    log.open()
    for _ in range(9):
        log.after_tick()
    log.close()
    motion = read_motion(tmp_path / "motion.jsonl")
    assert motion.ticks.tolist() == [0, 4, 8, 9]
    assert motion.times.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert motion.bodies == ("cup", "chest/door", "walker")
