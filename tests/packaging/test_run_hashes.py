"""Hashes of runs: equal for equal code and seed, others for another seed."""

from __future__ import annotations

import runpy
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from bestman_bt.configuration.data import data_names

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_a_run_is_compared_with_the_one_before(tmp_path: Path) -> None:
    def hashed(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [
            sys.executable,
            "scripts/run_hashes.py",
            "policy_reach",
            "--jobs",
            "1",
            *(str(one) for one in arguments),
        ]
        return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)

    before = tmp_path / "before.json"
    assert hashed("--seed", 1, "--out", before).returncode == 0
    again = hashed("--seed", 1, "--compare", before)
    assert (again.returncode, again.stdout.split()[-1]) == (0, "same")
    other = hashed("--seed", 2, "--compare", before)
    assert (other.returncode, other.stdout.split()[-1]) == (1, "DIFFERENT")


def test_without_tasks_all_shipped_ones_are_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Pool:
        def __init__(self, jobs: int) -> None:
            self.jobs = jobs

        def __enter__(self) -> Pool:
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def map(self, call: Callable[..., object], tasks: Iterable[str], seeds: Iterable[int]) -> Iterator[object]:
            return iter([{"outcome": "success", "changes": task, "beliefs": str(self.jobs)} for task in tasks])

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    monkeypatch.setattr(sys, "argv", ["run_hashes.py"])
    assert runpy.run_path(str(CHECKOUT / "scripts" / "run_hashes.py"))["main"]() == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == list(data_names("task"))
