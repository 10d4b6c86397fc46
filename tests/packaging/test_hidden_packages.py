"""A file beside a script that has the name of one of our packages is named; without robots it may stay."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


def run(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    script = folder / "script.py"
    script.write_text(text)
    return subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("name", "used"), [("behaviours", "bestman_bt import Session"), ("hal", "bestman_bt.runtime import session")]
)
def test_a_script_beside_a_file_that_hides_our_package_is_told_which(name: str, used: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text("class Count: ...\n")
    ran = run(tmp_path, f"from {used}\n")
    last = ran.stderr.splitlines()[-1]
    assert last.startswith(f"ImportError: {tmp_path / name}.py hides the package '{name}' of bestman-bt")
    assert "is not a package" not in ran.stderr


def test_the_engine_alone_can_be_used_beside_it_and_reports_it_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "behaviours.py").write_text("class Count: ...\n")
    ran = run(tmp_path, "from bestman_bt.engine import Sequence\nfrom behaviours import Count\nprint(Count)\n")
    assert ran.stdout == "<class 'behaviours.Count'>\n"
    (line,) = ran.stderr.splitlines()
    assert line.startswith(f"{tmp_path / 'behaviours.py'} hides the package 'behaviours' of bestman-bt")
