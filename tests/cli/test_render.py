from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer
from tests.evaluation.report.run_folders import write_run

Command = Callable[..., Answer]


def test_a_run_without_motion_is_refused_with_the_reason(bestman_bt: Command, folder: Path) -> None:
    write_run(folder / "run")

    answer = bestman_bt("render", "run")

    assert answer.code == 2
    assert "has no motion.jsonl: only simulated runs write one" in answer.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "name a run folder"),
        (["nowhere"], "nowhere is not a run folder"),
        (["nowhere", "--size", "large"], "a size is WIDTHxHEIGHT"),
        (["nowhere", "--size", "²x²"], "a size is WIDTHxHEIGHT"),
        (["nowhere", "--size", f"{'9' * 5000}x720"], "a size is WIDTHxHEIGHT"),
    ],
)
def test_wrong_input_is_reported(bestman_bt: Command, arguments: list[str], words: str) -> None:
    answer = bestman_bt("render", *arguments)

    assert answer.code == 2
    assert words in " ".join(answer.err.replace("│", " ").split())
