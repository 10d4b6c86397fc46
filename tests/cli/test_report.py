from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.command_line import Answer, Program, wait_for
from tests.evaluation.report.run_folders import write_run

Command = Callable[..., Answer]


def test_a_report_of_a_run_is_written_where_it_is_asked_for(bestman_bt: Command, folder: Path) -> None:
    write_run(folder / "runs" / "one")

    answer = bestman_bt("report", "runs/one", "-o", "one.html")

    assert (answer.code, answer.out.strip()) == (0, "one.html")
    assert "fetch_cup, seed 1: success" in (folder / "one.html").read_text()


def test_a_report_of_one_run_is_written_into_its_folder(bestman_bt: Command, folder: Path) -> None:
    run = write_run(folder / "runs" / "one")

    answer = bestman_bt("report", "runs/one")

    assert (answer.code, answer.out.strip()) == (0, str((run / "report.html").resolve()))
    assert "fetch_cup, seed 1: success" in (run / "report.html").read_text()


@pytest.mark.parametrize("verb", [("report",), ("replay",), ("export", "--format", "jsonl", "-o", "x.jsonl")])
def test_without_a_run_the_latest_ones_are_named(bestman_bt: Command, folder: Path, verb: tuple[str, ...]) -> None:
    assert "There is none below runs" in bestman_bt(*verb).err
    for number in range(4):
        os.utime(write_run(folder / "runs" / str(number), seed=number) / "config.yaml", (number, number))
    answer = bestman_bt(*verb)
    assert answer.code == 2
    assert "The latest runs are runs/3, runs/2, runs/1\n" in answer.err


def test_runs_below_a_folder_come_into_one_report(bestman_bt: Command, folder: Path) -> None:
    for seed in (1, 2, 3):
        write_run(folder / "runs" / str(seed), seed=seed, success=seed != 2)

    assert bestman_bt("report", "runs", "runs/1").code == 0

    assert "2 of 3" in (folder / "report.html").read_text()


def test_what_is_damaged_is_reported_on_standard_error_too(bestman_bt: Command, folder: Path) -> None:
    (write_run(folder / "run") / "transitions.btlog").write_bytes(b"\x7fELF")

    answer = bestman_bt("report", "run")

    assert answer.code == 0
    assert "transitions.btlog was not read to its end" in answer.err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "nowhere is not a folder"),
        (["."], "is not a run folder and contains none"),
        ([".", "-o", "report.pdf"], "reports are HTML files"),
        ([".", "-o", "not/there.html"], "does not exist"),
    ],
)
def test_wrong_input_is_reported_and_nothing_is_written(
    bestman_bt: Command, folder: Path, arguments: list[str], words: str
) -> None:
    answer = bestman_bt("report", *arguments)

    assert answer.code == 2
    assert words in " ".join(answer.err.replace("│", " ").split())
    assert not list(folder.iterdir())


def test_a_page_that_cannot_be_written_is_reported(bestman_bt: Command, folder: Path) -> None:
    write_run(folder / "run")
    (folder / "full.html").symlink_to("/dev/full")

    answer = bestman_bt("report", "run", "-o", "full.html")

    assert answer.code == 2
    assert "full.html cannot be written: No space left on device" in answer.err


@pytest.mark.parametrize("verb", ["report", "render"])
def test_the_help_comes_without_the_simulator(verb: str) -> None:
    program = f"import sys; import bestman_bt.cli.{verb}_command; print('pybullet' in sys.modules)"

    imported = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)

    assert imported.stdout == "False\n"


@pytest.mark.slow
def test_a_run_that_was_killed_is_reported_as_interrupted_up_to_its_last_moments(
    bestman_bt: Command, folder: Path
) -> None:
    program = Program("run", "fetch_cup", "--seed", 1, folder=folder)
    log = wait_for(folder, "runs/*/transitions.btlog")
    head = log.stat().st_size
    end = time.monotonic() + 120.0
    while log.stat().st_size <= head + 9 * 20 and time.monotonic() < end:
        time.sleep(0.05)
    program.process.kill()
    program.process.communicate()

    assert bestman_bt("report", "runs").code == 0

    page = (log.parent / "report.html").read_text()
    assert "Interrupted." in page
    assert "NavigateTo" in page
