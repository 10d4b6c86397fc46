"""Hashes of runs: equal for equal code and seed, others for another seed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_a_run_is_compared_with_the_one_before(tmp_path: Path) -> None:
    def hashed(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [
            sys.executable,
            "scripts/run_hashes.py",
            "pick_bench",
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
