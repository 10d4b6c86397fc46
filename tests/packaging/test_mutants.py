"""The seeded faults of `make mutants` still apply to the code, and a survivor is told from a find."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
SCRIPT = CHECKOUT / "scripts" / "mutants.py"


@pytest.fixture(scope="module")
def mutants() -> ModuleType:
    spec = importlib.util.spec_from_file_location("mutants", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["mutants"] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def index(mutants: ModuleType) -> Any:
    return mutants.index_definitions(mutants.tracked_files())


@pytest.fixture(scope="module")
def faults(mutants: ModuleType) -> Any:
    return mutants.load_faults(CHECKOUT / "tests" / "mutants")


@pytest.fixture(scope="module")
def applied(mutants: ModuleType, faults: Any, index: Any) -> Any:
    return mutants.check(faults, index)


@pytest.mark.slow
def test_every_seeded_fault_applies_to_exactly_one_place(faults: Any, applied: Any) -> None:
    assert len(applied) == len(faults)
    sentences = [fault.fault for fault in faults]
    assert len(sentences) == len(set(sentences))
    for fault in faults:
        file, text = applied[fault.origin]
        assert text != (CHECKOUT / file).read_text(), fault.fault


def test_the_faults_are_many_and_spread_over_the_packages(mutants: ModuleType, faults: Any, applied: Any) -> None:
    packages = {mutants.package_of(file) for file, _ in applied.values()}
    assert len(faults) >= 120
    assert packages >= {
        *("behaviours", "configuration", "control", "engine", "evaluation", "hal", "manipulation", "monitor"),
        *("navigation", "perception", "robot_model", "runtime", "scene", "task_planning", "world_model"),
    }


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"before": "no such text"}, "exactly once in 0 of the 1 definitions"),
        ({"function": "no_such_function"}, "in 0 of the 0 definitions"),
        ({"after": "return ("}, "does not parse"),
        ({"tests": ("tests/no_such_test.py",)}, "there is no tests/no_such_test.py"),
    ],
)
def test_a_fault_that_no_longer_applies_is_an_error(
    mutants: ModuleType, index: Any, change: dict[str, object], words: str
) -> None:
    fields = {
        "origin": "here",
        "fault": "the suggestion is lost",
        "function": "suggestion",
        "package": "bestman_bt.registry",
        "before": "def suggestion(",
        "after": "def suggestion_(",
        "tests": ("tests/test_registry.py",),
    }
    mutants.check([mutants.Fault(**fields)], index)
    with pytest.raises(mutants.FaultError, match=words):
        mutants.check([mutants.Fault(**{**fields, **change})], index)


@pytest.mark.slow
def test_a_fault_is_found_and_a_change_without_effect_survives(mutants: ModuleType, tmp_path: Path) -> None:
    """The whole command on two entries in a checkout of its own: one real fault, one that changes nothing."""
    copy = tmp_path / "checkout"
    for name in ("scripts/mutants.py", "bestman_bt/registry.py", "bestman_bt/__init__.py", "tests/test_registry.py"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text((CHECKOUT / name).read_text())
    (copy / "tests/test_numbers.py").write_text(
        "from bestman_bt.numbers import double\n\n\ndef test_double() -> None:\n    assert double(2) == 4\n"
    )
    (copy / "bestman_bt/__init__.py").write_text("")
    (copy / "bestman_bt/numbers.py").write_text("def double(x):\n    return 2 * x\n")
    (copy / "tests/mutants").mkdir()
    entry = "- {{fault: {}, function: double, before: 2 * x, after: {}, tests: [tests/test_numbers.py]}}\n"
    (copy / "tests/mutants/numbers.yaml").write_text(
        entry.format("double adds three", "3 + x") + entry.format("nothing changes", "x + x")
    )
    (copy / "tests/test_registry.py").unlink()
    (copy / ".gitignore").write_text("runs/\n__pycache__/\n.pytest_cache/\n")
    for command in (["init", "-q"], ["add", "."]):
        subprocess.run(["git", *command], cwd=copy, check=True)
    seeded = []
    for _ in range(2):  # the second time it goes by its journal
        done = subprocess.run(
            [sys.executable, "scripts/mutants.py"], cwd=copy, capture_output=True, text=True, timeout=120, check=False
        )
        assert done.returncode == 1, done.stderr
        seeded.append(done.stdout.count("numbers: "))
    assert seeded == [2, 0]
    summary = json.loads((copy / "runs/mutants/summary.json").read_text())
    assert summary["packages"] == {"numbers": {"found": 1, "of": 2}}
    assert summary["survived"] == ["nothing changes"]
