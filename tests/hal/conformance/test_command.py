"""``pytest --pyargs hal.conformance`` as a third party runs it: in a folder of its own, on a driver of its own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from hal.conformance.command_line import pytest_sessionstart

CHECKOUT = Path(__file__).resolve().parents[3]
EXAMPLE = CHECKOUT / "examples" / "driver_in_memory"
PYTEST = Path(sys.executable).parent / "pytest"
USAGE_ERROR = 4

LAZY_DRIVER = """
from memory_robot import MemoryRobot

class Blind(MemoryRobot):
    def __init__(self, model, world, *, seed, gui):
        super().__init__(model, world, seed=seed, gui=gui)
        del self.parts["lidar"]

class Honest(Blind):
    @property
    def unsupported(self):
        return {"lidar": "it is being repaired"}

class Deaf(MemoryRobot):
    def clear_stop(self):
        pass
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for file in EXAMPLE.glob("*.py"):
        shutil.copy(file, tmp_path)
    (tmp_path / "lazy.py").write_text(LAZY_DRIVER)
    (tmp_path / "broken.py").write_text("1 / 0\n")
    return tmp_path


def run(folder: Path, *options: str) -> tuple[int, str]:
    """Exit code and output; the suite is the checkout's, from wherever this is run."""
    command = [str(PYTEST), "--pyargs", "hal.conformance", "-p", "no:cacheprovider", *options]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTEST_ADDOPTS": ""}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
def test_a_driver_beside_the_command_passes(folder: Path) -> None:
    code, said = run(folder, "--driver", "memory_robot:MemoryRobot", "--seed", "7")
    assert code == 0, said
    assert re.search(r"\d\d passed", said)
    lacking = re.findall(r"MemoryRobot \(diff_panda\): .*: (.*)$", said, flags=re.MULTILINE)
    assert set(lacking) == {
        "the robot has no imu",
        "the robot has no tactile",
        "the robot has no bumper",
        "the robot has no battery",
    }, said


@pytest.mark.slow
def test_what_is_wrong_with_the_options_ends_the_command_before_anything_runs(folder: Path) -> None:
    code, said = run(folder, "--driver", "broken:Robot")
    assert code == USAGE_ERROR, said
    assert "broken cannot be imported: ZeroDivisionError" in said
    assert "passed" not in said


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "name the driver to test: --driver my_package:MyRobot"),
        ({"driver": "memory_robot"}, "'memory_robot' should be MODULE:CLASS"),
        ({"driver": "absent.package:Robot"}, "absent.package cannot be imported: ModuleNotFoundError"),
        ({"driver": "broken:Robot"}, "broken cannot be imported: ZeroDivisionError"),
        ({"driver": "memory_robot:Robbie"}, "memory_robot has no 'Robbie'"),
        ({"driver": "memory_robot:Wheels"}, "cannot be made of (model, world, *, seed, gui)"),
        ({"driver": "memory_robot:MemoryRobot", "robot": "r2d2"}, "unknown robot 'r2d2'"),
        ({"driver": "memory_robot:MemoryRobot", "scene": "moon"}, "unknown scene 'moon'"),
    ],
)
def test_what_is_wrong_with_the_options_is_said(
    folder: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, str], words: str
) -> None:
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setitem(sys.modules, "memory_robot", None)  # so that it is taken away again
    del sys.modules["memory_robot"]
    given = {"driver": None, "robot": "diff_panda", "scene": None, "seed": 0, **options}
    config = SimpleNamespace(option=SimpleNamespace(**given), invocation_params=SimpleNamespace(dir=folder), stash={})
    with pytest.raises(pytest.UsageError, match=re.escape(words)):
        pytest_sessionstart(SimpleNamespace(config=config))
    assert config.stash == {}


@pytest.mark.slow
def test_what_is_declared_missing_is_listed_at_the_end(folder: Path) -> None:
    code, said = run(folder, "--driver", "lazy:Honest", "-q")
    assert code == 0, said
    end = said.partition("promises that do not apply")[2]
    assert "Honest (diff_panda): lidars give ranges within theirs: it is being repaired" in end
    assert "Honest (diff_panda): lidar: it is being repaired" in end.partition("what the drivers declare missing")[2]


@pytest.mark.slow
def test_what_is_missing_and_not_declared_fails(folder: Path) -> None:
    code, said = run(folder, "--driver", "lazy:Blind", "-q")
    assert code == 1, said
    assert "1 failed" in said
    assert "the model lists lidar, which the robot has not and does not declare missing" in said


@pytest.mark.slow
def test_a_driver_that_breaks_its_promises_fails(folder: Path) -> None:
    code, said = run(folder, "--driver", "lazy:Deaf", "-q", "-k", "stop")
    assert code == 1, said
    assert "one clear_stop() should be enough" in said


@pytest.mark.slow
def test_pytest_has_no_option_of_the_suite_where_nobody_asks_for_it(folder: Path) -> None:
    (folder / "test_nothing.py").write_text("def test_nothing(): pass\n")
    command = [str(PYTEST), "test_nothing.py", "--driver", "memory_robot:MemoryRobot"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == USAGE_ERROR
    assert "unrecognized arguments: --driver" in done.stderr
