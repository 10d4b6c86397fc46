"""An evaluation of a tree that does nothing, from the command line."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer

pytestmark = pytest.mark.slow

NOTHING = '<root BTCPP_format="4"><BehaviorTree ID="Main"><AlwaysFailure/></BehaviorTree></root>'
SUITE = "first_seed: 3\nepisodes: 1\ntasks:\n  '[bold]': {task: fetch_cup, settings: [tree=nothing.xml]}\n"


def test_names_are_shown_as_they_are_even_if_they_look_like_markup_or_are_no_text(
    bestman_bt: Callable[..., Answer], folder: Path
) -> None:
    (folder / "nothing.xml").write_text(NOTHING)
    suite = os.fsdecode(b"caf\xe9.yaml")
    (folder / suite).write_text(SUITE)
    answer = bestman_bt("eval", suite, "--shard", "1/1", "--out", "a[/b]")
    assert answer.code == 0, answer.err
    assert "kept in a[/b]/shards/1_of_1" in answer.err
    assert "caf\\udce9" in (folder / "a[/b]/shards/1_of_1/summary.md").read_text()
    journal = folder / "a[/b]/shards/1_of_1/episodes.jsonl"
    journal.write_bytes(b"damaged\n" + journal.read_bytes())
    answer = bestman_bt("eval", suite, "--shard", "1/1", "--out", "a[/b]")
    assert f"note: {journal.relative_to(folder)}: damaged lines were left out (1)" in answer.err
