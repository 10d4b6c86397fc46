"""The journal: finished episodes are found again, whatever the moment of the interruption; one writer at a time."""

from __future__ import annotations

import errno
import json
import os
import resource
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.evaluation.journal import EpisodeKey, Journal, JournalError, read_episodes
from tests.evaluation.test_summary import result

KEY = EpisodeKey("c0ffee", 7, "abc")


def test_what_was_added_is_there_when_it_is_opened_again(tmp_path: Path) -> None:
    path = tmp_path / "deeper" / "episodes.jsonl"
    with Journal(path) as journal:
        journal.add(KEY, "1234", result(7, predicate=False))
    with Journal(path) as again:
        assert list(again.results) == [KEY]
        assert again.results[KEY].to_document() == result(7, predicate=False).to_document()


def test_a_journal_without_episodes_leaves_nothing_behind(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    with pytest.raises(ConfigurationError, match="refused"), Journal(tmp_path / "mine" / "new" / "deep" / "a.jsonl"):
        raise ConfigurationError([Problem("--address", None, "", "refused")])
    assert list((tmp_path / "mine").iterdir()) == []
    with Journal(tmp_path / "mine" / "kept" / "a.jsonl"):
        (tmp_path / "mine" / "kept" / "summary.json").write_text("{}")
    assert [path.name for path in (tmp_path / "mine" / "kept").iterdir()] == ["summary.json"]


def test_a_line_that_was_cut_off_does_not_count_and_is_written_over(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    other = EpisodeKey("c0ffee", 8, "abc")
    with Journal(path) as journal:
        journal.add(KEY, "", result(7))
        journal.add(other, "", result(8))
    path.write_text(path.read_text()[:-40])
    with Journal(path) as cut:
        assert list(cut.results) == [KEY]
        cut.add(other, "", result(8))
    with Journal(path) as whole:
        assert list(whole.results) == [KEY, other]


@contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let this process write no file beyond ``size`` bytes, as a disk that fills."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_is_reported_and_the_journal_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    others = [EpisodeKey("c0ffee", seed, "abc") for seed in (8, 9)]
    with Journal(path) as journal:
        journal.add(KEY, "", result(7))
    with room_for(path.stat().st_size + 100), Journal(path) as journal:
        with pytest.raises(JournalError, match=r"episodes.jsonl can no longer be written: .*; the 1 episodes in it"):
            journal.add(others[0], "", result(8))
        assert list(journal.results) == [KEY]
    with Journal(path) as again:
        assert list(again.results) == [KEY]
        again.add(others[1], "", result(9))
    assert list(read_episodes(path)) == [KEY, others[1]]


def test_an_episode_that_is_written_counts_although_the_disk_does_not_confirm_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fsync(_: object) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO))

    other = EpisodeKey("c0ffee", 8, "abc")
    with Journal(tmp_path / "episodes.jsonl") as journal:
        with monkeypatch.context() as patch:
            patch.setattr("bestman_bt.evaluation.journal.os.fsync", fsync)
            with pytest.raises(JournalError, match="the 1 episodes in it are kept"):
                journal.add(KEY, "", result(7))
        journal.add(other, "", result(8))
        assert [journal.results[key].seed for key in (KEY, other)] == [7, 8]


def test_a_file_that_is_no_journal_is_refused_by_its_line_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    path.write_text('{"task": "fetch_cup"}\n')
    with pytest.raises(ConfigurationError, match=r"episodes.jsonl: line 1 is not a finished episode"):
        Journal(path).__enter__()
    assert path.read_text() == '{"task": "fetch_cup"}\n'


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    with Journal(path), pytest.raises(ConfigurationError, match="another evaluation is writing it"):
        Journal(path).__enter__()


@pytest.mark.parametrize("damage", [b"\xff\xfe\x00", b"", b'{"seed": 7}'])
def test_a_line_damaged_in_the_middle_is_skipped_and_the_original_file_is_kept(tmp_path: Path, damage: bytes) -> None:
    path = tmp_path / "episodes.jsonl"
    others = [EpisodeKey("c0ffee", seed, "abc") for seed in (8, 9)]
    with Journal(path) as journal:
        for key in (KEY, *others):
            journal.add(key, "", result(key.seed))
    lines = path.read_bytes().split(b"\n")
    path.write_bytes(b"\n".join([lines[0], damage, *lines[2:]]))
    broken = path.read_bytes()
    with pytest.raises(ConfigurationError, match=r"line 2 is not a finished episode: .*; repeat the command that"):
        read_episodes(path)
    with Journal(path) as mended:
        assert list(mended.results) == [KEY, others[1]]
        copy = tmp_path / "episodes.jsonl.damaged"
        assert mended.notes == [f"{path}: damaged lines were left out (2); the original file: {copy}"]
        assert copy.read_bytes() == broken
        mended.add(others[0], "", result(8))
    assert list(read_episodes(path)) == [KEY, *others]


def test_the_disk_has_an_episode_half_a_second_later_and_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[float] = []
    now = 100.0
    monkeypatch.setattr("bestman_bt.evaluation.journal.time.monotonic", lambda: now)
    monkeypatch.setattr("bestman_bt.evaluation.journal.os.fsync", lambda file: synced.append(now))
    with Journal(tmp_path / "episodes.jsonl") as journal:
        for step in range(5):
            now = 100.0 + 0.2 * step
            journal.add(KEY, "", result(7))
            assert list(read_episodes(tmp_path / "episodes.jsonl")) == [KEY]  # the operating system has it at once
    assert synced == pytest.approx([100.0, 100.6, 100.8])


def test_a_lock_file_takes_the_place_of_locks_where_the_file_system_has_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr("bestman_bt.evaluation.writer_lock.fcntl.flock", flock)
    path, lock = tmp_path / "episodes.jsonl", tmp_path / "episodes.lock"
    with (
        Journal(path),
        pytest.raises(ConfigurationError, match=rf"another evaluation .* if that has ended, delete {lock}"),
    ):
        Journal(path).__enter__()
    assert not lock.exists()
    lock.write_text(f"process 0 on {socket.gethostname()}")  # there is no process 0: its evaluation was killed
    with Journal(path):
        assert f"process {os.getpid()} on" in lock.read_text()
    lock.write_text("process 0 on another-machine")
    with pytest.raises(ConfigurationError, match="process 0 on another-machine"):
        Journal(path).__enter__()
    assert lock.exists()


def line(**changes: Any) -> str:
    entry = {"config": "c0ffee", "seed": 7, "code": "abc", "commit": "", "result": result(7).to_document(), **changes}
    return json.dumps(entry) + "\n"


@pytest.mark.parametrize(
    "changes",
    [{"seed": True}, {"seed": 5.0}, {"seed": "5"}, {"seed": 2**63}, {"config": None}, {"code": ["x"]}],
    ids=str,
)
def test_a_line_whose_identity_is_none_is_damaged(tmp_path: Path, changes: dict[str, Any]) -> None:
    path = tmp_path / "episodes.jsonl"
    path.write_text(line(**changes))
    for _ in range(2):  # it is left as it is
        with pytest.raises(ConfigurationError, match="line 1 is not a finished episode: .*config and code should be"):
            Journal(path).__enter__()
    with pytest.raises(ConfigurationError, match="line 1 is not a finished episode"):
        read_episodes(path)
    path.write_text(line() + line(**changes))
    with Journal(path) as mended:
        assert list(mended.results) == [KEY]
        assert len(mended.notes) == 1


def test_the_codes_of_an_episode_are_in_the_order_of_time_or_of_their_lines(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    lines = [line(code=code, seed=seed) for code, seed in (("a", 1), ("b", 5), ("b", 1), ("a", 5))]
    noon, one = "2026-01-01T12:00:00.000+00:00", "2026-01-01T13:00:00.000+00:00"
    lines += [line(code=code, seed=7, ended=when) for code, when in (("a", one), ("b", noon))]
    lines += [line(code=code, seed=8, ended=when) for code, when in (("a", noon), ("b", None), ("c", {}), ("d", 9))]
    path.write_text("".join([*lines, line(code="c", seed=7)]))
    found = read_episodes(path)
    orders = [["a", "b"], ["b", "a"], ["c", "b", "a"], ["b", "c", "d", "a"], []]
    assert [found.codes("c0ffee", seed) for seed in (1, 5, 7, 8, 9)] == orders


def test_an_episode_is_read_while_others_are_added(tmp_path: Path) -> None:
    others = [EpisodeKey("c0ffee", seed, "abc") for seed in range(20)]
    with Journal(tmp_path / "episodes.jsonl") as journal:
        for key in others:
            journal.add(key, "", result(key.seed))
            assert json.loads(journal.line(others[key.seed // 2]))["seed"] == key.seed // 2
    assert list(read_episodes(tmp_path / "episodes.jsonl")) == others
