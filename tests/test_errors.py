"""All errors of the project have one base, and what a user wrote wrongly ends with exit code 2."""

from __future__ import annotations

import builtins
import re
import subprocess
import sys
from pathlib import Path

import pytest

import bestman_bt
from bestman_bt.cli.main import input_errors
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import TreeLoadError
from bestman_bt.errors import AlgorithmError, Error, InputError, MissingExtraError, RobotError
from bestman_bt.navigation.map_file import MapFileError
from bestman_bt.registry import UnknownNameError
from bestman_bt.scene.draw import SceneError
from bestman_bt.task_planning.symbolic.problem import GoalError
from hal.parts.part_connection import ConnectionFailedError

CHECKOUT = Path(__file__).resolve().parents[1]
SOURCES = [file for folder in ("bestman_bt", "behaviours", "hal") for file in (CHECKOUT / folder).rglob("*.py")]
BUILT_IN = {name for name, kind in vars(builtins).items() if isinstance(kind, type) and issubclass(kind, BaseException)}
KINDS = {kind.__name__ for kind in (Error, InputError, RobotError, AlgorithmError, MissingExtraError)}
CLASS = re.compile(r"^ *class (\w+)\(([^)]+)\):", re.MULTILINE)


def test_every_exception_class_derives_from_the_one_base() -> None:
    bases = [
        (f"{file.relative_to(CHECKOUT)}: {name}", name, set(re.findall(r"\w+", listed)))
        for file in SOURCES
        if file.name != "errors.py" or file.parent.name != "bestman_bt"
        for name, listed in CLASS.findall(file.read_text(encoding="utf-8"))
    ]
    ours = set(KINDS)
    while new := {name for _, name, listed in bases if listed & ours} - ours:
        ours |= new
    assert len(ours) > 80
    assert [where for where, _, listed in bases if listed & BUILT_IN and not listed & ours] == []


def test_no_error_is_recognised_by_the_name_of_its_class() -> None:
    compared = re.compile(r"__name__ (==|!=|in)\b (?!.__main__)|for \w+ in type\(error\)\.__mro__")
    found = [f"{file}: {line}" for file in SOURCES for line in file.read_text().splitlines() if compared.search(line)]
    assert [line for line in found if '"bool"' not in line] == []  # numpy's, in the engine, which has no numpy


@pytest.mark.parametrize(
    "kind",
    [ConfigurationError, TreeLoadError, MapFileError, UnknownNameError, SceneError, GoalError, ConnectionFailedError],
)
def test_what_a_user_gave_wrongly_is_an_input_error(kind: type[Error]) -> None:
    assert issubclass(kind, InputError)


def test_input_errors_end_with_exit_code_2_and_others_pass(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended, input_errors(starts=True):
        raise InputError("size: should be above 0, got -1")
    assert ended.value.code == 2
    assert capsys.readouterr().err == "bestman-bt: nothing was started: size: should be above 0, got -1\n"
    with pytest.raises(AlgorithmError), input_errors(starts=True):
        raise AlgorithmError("no way")


def test_the_base_is_there_at_once_without_the_rest() -> None:
    assert bestman_bt.Error is Error
    script = "import bestman_bt, sys; bestman_bt.Error; print([m for m in sys.modules if m.split('.')[0] == 'numpy'])"
    done = subprocess.run([sys.executable, "-c", script], cwd=CHECKOUT, capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
