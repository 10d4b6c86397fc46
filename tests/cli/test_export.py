from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer
from tests.evaluation.report.run_folders import write_run

Command = Callable[..., Answer]


def test_a_run_and_its_log_alone_are_exported_alike(bestman_bt: Command, folder: Path) -> None:
    run = write_run(folder / "run")

    answer = bestman_bt("export", "run", "--format", "jsonl", "-o", "run.jsonl")
    assert (answer.code, answer.out.strip()) == (0, "run.jsonl")
    assert bestman_bt("export", run / "transitions.btlog", "--format", "jsonl", "-o", "log.jsonl").code == 0

    exported = (folder / "run.jsonl").read_text()
    assert exported == (folder / "log.jsonl").read_text()
    assert json.loads(exported.splitlines()[0])["to"] == "RUNNING"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere", "--format", "chrome", "-o", "x"), "nowhere is not a run folder"),
        (("run", "--format", "csv", "-o", "x"), "'csv' is not one of 'sqlite', 'chrome', 'jsonl'"),
        (("run", "--format", "chrome", "-o", "no/x"), "the folder 'no' does not exist"),
        (("run", "--format", "sqlite", "-o", "other.txt"), "cannot be written: file is not a database"),
    ],
)
def test_what_cannot_be_exported_is_reported(
    bestman_bt: Command, folder: Path, arguments: tuple[str, ...], words: str
) -> None:
    write_run(folder / "run")
    (folder / "other.txt").write_text("not a database" * 100)

    answer = bestman_bt("export", *arguments)

    assert answer.code == 2
    assert words in answer.err
    assert not (folder / "x").exists()
