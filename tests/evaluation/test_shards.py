"""Shards: every episode is run by exactly one; their journals make the summary of one evaluation, or errors."""

from __future__ import annotations

import json
import resource
import tracemalloc
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.code_version import code_fingerprint, config_fingerprint
from bestman_bt.evaluation.evaluation import Evaluation
from bestman_bt.evaluation.journal import EpisodeKey, Journal
from bestman_bt.evaluation.shards import KnownDurations, Shard
from bestman_bt.evaluation.suite import Suite, SuiteEntry
from tests.evaluation.test_summary import result

FIRST, EPISODES = 5, 7


@pytest.fixture(scope="module")
def suite() -> Suite:
    entries = (("plain", []), ("slippery", ["scene.finger_friction=0.001"]))
    return Suite(
        "mine",
        tuple(SuiteEntry(name, load_run("fetch_cup", seed=FIRST, settings=given), EPISODES) for name, given in entries),
    )


@pytest.fixture(scope="module")
def keys(suite: Suite) -> list[EpisodeKey]:
    code = code_fingerprint()
    return [
        EpisodeKey(config_fingerprint(entry.config), seed, code)
        for entry in suite.entries
        for seed in range(FIRST, FIRST + EPISODES)
    ]


def write(folder: Path, keys: Sequence[EpisodeKey], **changes: Any) -> None:
    with Journal(folder / "episodes.jsonl") as journal:
        for key in keys:
            journal.add(key, "", replace(result(key.seed), **changes))


def merged(suite: Suite, folder: Path, *shards: Path) -> dict[str, Any]:
    with Evaluation(suite, folder) as evaluation:
        return evaluation.merge(shards)


@pytest.mark.parametrize("of", [1, 3, 16])
@pytest.mark.parametrize("seconds", [None, [5.0, 1, 1, 1, 1, 1, 9, 2, 2, 3]])
def test_every_episode_is_run_by_exactly_one_shard(of: int, seconds: Sequence[float] | None) -> None:
    parts = [Shard(number, of).part(range(10), seconds) for number in range(1, of + 1)]
    assert sorted(one for part in parts for one in part) == list(range(10))
    assert all(part == sorted(part) for part in parts)


@pytest.mark.slow
def test_known_durations_balance_the_shards(suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path) -> None:
    write(tmp_path / "before", keys[:1], wall_time_s=90.0)
    write(tmp_path / "before", keys[1:4], wall_time_s=10.0)
    known = KnownDurations(tmp_path / "before")
    config, other = keys[0].config, keys[-1].config
    assert [known.seconds(config, seed) for seed in (FIRST, FIRST + 1, FIRST + 6)] == [90.0, 10.0, 30.0]
    assert known.seconds(other, FIRST) == 30.0
    asked = [Evaluation(suite, shard=Shard(number, 4), balance=known).asked.total() for number in (1, 2, 3, 4)]
    assert asked == [2, 4, 4, 4]  # 120 and three times 100 seconds


@pytest.mark.parametrize("text", ["17/16", "0/16", "3", "a/b", "-1/2", "1/0", ""])
def test_a_part_that_is_none_is_refused(text: str) -> None:
    with pytest.raises(ConfigurationError, match=r"--shard: should be K/N with 1 ≤ K ≤ N"):
        Shard.parse(text)


@pytest.mark.parametrize(
    ("environment", "shard"),
    [({"ID": "7", "MIN": "5", "MAX": "20"}, "3/16"), ({"ID": "6", "MIN": "0", "MAX": "9", "STEP": "3"}, "3/4")],
)
def test_a_task_of_an_array_job_is_its_shard(environment: Mapping[str, str], shard: str) -> None:
    assert (
        str(Shard.parse("slurm", {f"SLURM_ARRAY_TASK_{name}": value for name, value in environment.items()})) == shard
    )


@pytest.mark.parametrize(
    ("environment", "why"),
    [
        ({}, "ID, SLURM_ARRAY_TASK_MIN, SLURM_ARRAY_TASK_MAX is not set"),
        ({"ID": "21", "MIN": "5", "MAX": "20"}, "task 21 is none of 5 to 20"),
    ],
)
def test_slurm_without_an_array_job_is_refused(environment: Mapping[str, str], why: str) -> None:
    with pytest.raises(ConfigurationError, match=why):
        Shard.parse("slurm", {f"SLURM_ARRAY_TASK_{name}": value for name, value in environment.items()})


def test_shards_make_the_document_of_one_evaluation(suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path) -> None:
    write(tmp_path / "whole", keys)
    with Evaluation(suite, tmp_path / "whole") as evaluation:
        whole = evaluation.document()
    shards = []
    for number in (3, 1, 2):
        shards.append(tmp_path / "shards" / str(number))
        write(shards[-1], Shard(number, 3).part(keys))
    assert merged(suite, tmp_path / "out", tmp_path / "shards") == whole
    assert merged(suite, tmp_path / "other", *shards) == whole
    assert merged(suite, tmp_path / "out", tmp_path / "shards") == whole  # once more
    assert not any(entry["missing"] for entry in whole["entries"])


def test_the_order_of_the_shards_does_not_change_the_journal(
    suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path
) -> None:
    write(tmp_path / "one", keys[::2])
    write(tmp_path / "two", keys[:0:-1], wall_time_s=2.0)
    write(tmp_path / "three", keys[:3], sim_time_s=99.0)
    shards = [tmp_path / name for name in ("one", "two", "three")]
    merged(suite, tmp_path / "a", *shards)
    merged(suite, tmp_path / "b", *reversed(shards))
    journals = [(tmp_path / name / "episodes.jsonl").read_bytes() for name in ("a", "b")]
    assert journals[0] == journals[1]


@pytest.mark.slow
def test_an_episode_that_is_merged_takes_no_more_memory_than_its_numbers(suite: Suite, tmp_path: Path) -> None:
    entry, code = suite.entries[0], code_fingerprint()
    config = config_fingerprint(entry.config)
    taken = []
    for episodes in (500, 3500):
        shards = tmp_path / str(episodes)
        for number in range(4):
            mine = range(FIRST + number, FIRST + episodes, 4)
            write(shards / str(number), [EpisodeKey(config, seed, code) for seed in mine])
        evaluation = Evaluation(Suite("large", (replace(entry, episodes=episodes),)), tmp_path / f"{episodes}_out")
        tracemalloc.start()
        with evaluation:
            assert evaluation.merge([shards])["episodes"] == episodes
        taken.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    numbers = 2 + len({**result(0).metrics, **result(0).durations, "time_s": 0.0})
    assert (taken[1] - taken[0]) / 3000 < 9 * numbers + 100


def test_a_merge_opens_each_journal_as_often_for_many_episodes_as_for_few(
    suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: Counter[Path] = Counter()
    real = Path.open

    def counted(path: Path, *arguments: Any, **options: Any) -> Any:
        opened[path] += 1
        return real(path, *arguments, **options)

    for name, mine in (("few", keys[:2]), ("many", keys)):
        write(tmp_path / name / "one", mine)
        write(tmp_path / name / "two", mine, wall_time_s=2.0)
    monkeypatch.setattr(Path, "open", counted)
    for name in ("few", "many"):
        merged(suite, tmp_path / f"{name}_out", tmp_path / name)
    shards = [
        [opened[tmp_path / name / part / "episodes.jsonl"] for part in ("one", "two")] for name in ("few", "many")
    ]
    assert shards[0] == shards[1]


def test_more_shards_can_be_merged_than_a_process_may_open_files(
    suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path
) -> None:
    for number in range(80):
        write(tmp_path / "shards" / str(number), keys[:1])
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    few = len(list(Path("/proc/self/fd").iterdir())) + 40
    resource.setrlimit(resource.RLIMIT_NOFILE, (few, before[1]))
    try:
        assert merged(suite, tmp_path / "out", tmp_path / "shards")["episodes"] == 1
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def test_of_several_old_codes_the_one_that_ran_last_counts_after_a_merge(
    suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path
) -> None:
    for hour, code in enumerate("ba"):
        key = replace(keys[0], code=code)
        entry = {
            **asdict(key),
            "ended": f"2026-01-01T0{hour}:00",
            "result": result(FIRST, predicate=hour == 1).to_document(),
        }
        with Journal(tmp_path / "shards" / code / "episodes.jsonl") as journal:
            journal.add_line(key, json.dumps(entry).encode() + b"\n")
    with Evaluation(suite, tmp_path / "out", keep_old=True) as evaluation:
        assert evaluation.merge([tmp_path / "shards"])["entries"][0]["succeeded"] == 1


def test_missing_episodes_are_named(suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path) -> None:
    write(tmp_path / "one", Shard(1, 2).part(keys))
    document = merged(suite, tmp_path / "out", tmp_path / "one")
    assert [entry["missing"] for entry in document["entries"]] == [[6, 8, 10], [5, 7, 9, 11]]
    assert not document["met"]


def test_a_shard_that_contradicts_another_is_an_error(suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path) -> None:
    write(tmp_path / "one", keys, wall_time_s=1.0)
    write(tmp_path / "two", keys[1:], wall_time_s=2.0)
    assert merged(suite, tmp_path / "same", tmp_path / "one", tmp_path / "two")["met"]
    write(tmp_path / "three", keys[:1], sim_time_s=99.0)
    document = merged(suite, tmp_path / "out", tmp_path / "one", tmp_path / "two", tmp_path / "three")
    paths = [tmp_path / name / "episodes.jsonl" for name in ("one", "three")]
    conflict = [f"plain, seed {FIRST}: {paths[0]} and {paths[1]} differ in sim_time_s"]
    assert (document["contradictions"], document["met"]) == (conflict, False)
    with Evaluation(suite, tmp_path / "out") as evaluation:
        assert (evaluation.document()["contradictions"], evaluation.document()["met"]) == (conflict, False)
    assert merged(suite, tmp_path / "next", tmp_path / "out")["contradictions"] == conflict
    again = merged(suite, tmp_path / "next", tmp_path / "one", tmp_path / "out")
    assert again["contradictions"] == conflict
    assert again["episodes"] == len(keys)


def test_shards_of_other_suites_and_other_code_are_refused_all_at_once(
    suite: Suite, keys: Sequence[EpisodeKey], tmp_path: Path
) -> None:
    write(tmp_path / "mine", keys)
    write(tmp_path / "other_seeds", [replace(keys[0], seed=FIRST + EPISODES), keys[0]])
    write(tmp_path / "other_code", [replace(keys[0], code="0ld")])
    (tmp_path / "empty").mkdir()
    with pytest.raises(ConfigurationError) as refused:
        merged(suite, tmp_path / "out", *(tmp_path / name for name in ("mine", "other_seeds", "other_code")))
    assert [str(problem) for problem in refused.value.problems] == [
        f"{tmp_path}/other_seeds/episodes.jsonl: 1 of 2 episodes are not of this suite, its settings, its seeds or "
        "its files",
        f"{tmp_path}/other_code/episodes.jsonl: was run with other code (0ld, here {keys[0].code}); --keep-old counts "
        "it",
    ]
    with pytest.raises(ConfigurationError, match="empty: has no journal"):
        merged(suite, tmp_path / "out", tmp_path / "mine", tmp_path / "empty")
