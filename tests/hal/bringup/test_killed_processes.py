"""The processes of a robot's program are found whatever threads and processes end while they are looked for."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from bestman_bt.bringup.killed_processes import python_children


def test_a_child_is_found_though_a_thread_and_another_process_end_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    folders, read_text = Path.iterdir, Path.read_text

    def with_a_thread_that_has_ended(folder: Path) -> Iterator[Path]:
        yield folder / "0"
        yield from folders(folder)

    def with_a_process_that_has_ended(file: Path) -> str:
        return f"0 {read_text(file)}"

    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen([sys.executable, "-c", "input(1)"], **pipes) as child:
        assert child.stdout is not None
        child.stdout.read(1)  # a process has its command line a moment after it was started
        monkeypatch.setattr(Path, "iterdir", with_a_thread_that_has_ended)
        monkeypatch.setattr(Path, "read_text", with_a_process_that_has_ended)
        assert child.pid in python_children(os.getpid())
        child.kill()


def test_a_process_that_has_ended_has_no_children() -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    assert python_children(child.pid) == []
