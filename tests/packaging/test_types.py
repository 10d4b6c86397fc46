"""A user's script is checked by mypy against the types of the packages: ports, parts and results."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

CHECKOUT = Path(__file__).resolve().parents[2]
CACHED = ("--config-file", str(CHECKOUT / "pyproject.toml"), "--cache-dir", str(CHECKOUT / ".mypy_cache"))
"""What `make types` has read of the packages is not read again."""
SCRIPT = """\
# mypy: enable-error-code="type-abstract"
import bestman_bt as bt
from bestman_bt.engine import SUCCESS, In, Out, SyncAction
from bestman_bt.messages import Pose2D
from hal.api import Arm, Robot


class Mine(SyncAction):
    goal = In(Pose2D, "where")
    found = Out(str, "what")

    def on_tick(self) -> int:
        self.goal.upper()
        self.found = 3
        return SUCCESS


def use(robot: Robot) -> None:
    robot.part("arm", Arm).open_wide()


print(bt.Session(robot="diff_panda", scene="kitchen").run("fetch_cup").sucess)
bt.load_tree("tree.xml", plugin=())
"""
MISTAKES = [
    (13, '"Pose2D" has no attribute "upper"'),
    (14, 'expression has type "int", variable has type "str"'),
    (19, '"Arm" has no attribute "open_wide"'),
    (22, '"RunResult" has no attribute "sucess"; maybe "success"?'),
    (23, 'Unexpected keyword argument "plugin" for "load_tree"; did you mean "plugins"?'),
]


def test_a_wrong_port_part_and_result_field_of_a_script_are_found_by_mypy(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(SCRIPT)
    command = [sys.executable, "-m", "mypy", *CACHED, "--hide-error-context", "mine.py"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    found = [line for line in done.stdout.splitlines() if ": error:" in line]
    assert len(found) == len(MISTAKES), done.stdout
    for line, (number, words) in zip(found, MISTAKES, strict=True):
        assert line.startswith(f"mine.py:{number}: error:"), done.stdout
        assert words in line, done.stdout
