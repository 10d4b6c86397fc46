"""Refused words stay out of docstrings, messages and pages; those that are left only become fewer."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "plain_english.py"


@pytest.fixture(scope="module")
def check() -> ModuleType:
    spec = importlib.util.spec_from_file_location("plain_english", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow  # `make test` has just run the same check, by `make lint`
def test_code_and_pages_have_no_refused_words(check: ModuleType) -> None:
    assert check.faults(check.code_texts(), check.page_texts()) == []


def test_a_refused_word_is_found_with_its_line_in_docstrings_messages_and_pages(check: ModuleType) -> None:
    source = '"""A module.\n\nIts second\nparagraph counts for want\nof a better one."""\nx = f"{1}: Nobody answers"\n'
    texts = [("a.py", line, text) for line, text in check.texts_of(source)]
    found = check.faults(texts, [("a.md", 1, "One.\n\nWhoever asks.")])
    assert sorted(fault.split(": write")[0] for fault in found) == [
        "a.md:3: 'whoever'",
        "a.py:4: 'for want of'",
        "a.py:6: 'nobody'",
    ]


def test_a_phrase_that_is_left_may_not_become_more(check: ModuleType) -> None:
    most = check.LEFT["told"][1]
    assert check.faults([], [("a.md", 1, "told " * most)]) == []
    [fault] = check.faults([], [("a.md", 1, "told " * (most + 1))])
    assert fault.startswith(f"'told': {most + 1} times in pages, at most {most}: ")


def test_code_and_links_of_pages_are_not_prose(check: ModuleType) -> None:
    assert check.QUOTED.sub("", "see `nobody` and [it](somebody.md) ```\nwhoever\n``` now").split() == [
        "see",
        "and",
        "[it",
        "now",
    ]
