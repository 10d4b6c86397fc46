"""The journal: finished episodes are found again, whatever the moment of the interruption; one writer at a time."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.configuration import ConfigurationError
from bestman_bt.evaluation.journal import EpisodeKey, Journal
from tests.evaluation.test_summary import result

KEY = EpisodeKey("c0ffee", 7, "abc")


def test_what_was_added_is_there_when_it_is_opened_again(tmp_path: Path) -> None:
    path = tmp_path / "deeper" / "episodes.jsonl"
    with Journal(path) as journal:
        journal.add(KEY, "1234", result(7, predicate=False))
    with Journal(path) as again:
        assert list(again.results) == [KEY]
        assert again.results[KEY].to_document() == result(7, predicate=False).to_document()


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


def test_a_file_that_is_no_journal_is_refused_by_its_line_and_left_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    path.write_text('{"task": "fetch_cup"}\n')
    with pytest.raises(ConfigurationError, match=r"episodes.jsonl: line 1 is no finished episode"):
        Journal(path).__enter__()
    assert path.read_text() == '{"task": "fetch_cup"}\n'


def test_a_second_writer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "episodes.jsonl"
    with Journal(path), pytest.raises(ConfigurationError, match="another evaluation is writing it"):
        Journal(path).__enter__()
