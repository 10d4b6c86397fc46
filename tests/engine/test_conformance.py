"""Every recorded case passes, in every mode of listening."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

HERE = Path(__file__).parent


def _runner() -> ModuleType:
    specification = importlib.util.spec_from_file_location("conformance_runner", HERE / "conformance.py")
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[specification.name] = module
    specification.loader.exec_module(module)
    return module


runner = _runner()
CASES = runner.read_cases([HERE / "cases"])
DEVIATIONS = runner.named_deviations()


@pytest.mark.parametrize("mode", runner.MODES)
@pytest.mark.parametrize("case", CASES, ids=[case["id"] for case in CASES])
def test_case_gives_the_recorded_trace(case: dict, mode: str) -> None:
    outcome = runner.run_case(case, mode)
    if case["id"] in DEVIATIONS:
        assert not outcome.passed, "the deviation is gone: remove it from docs/deviations.md"
    else:
        assert outcome.passed, outcome.why


def test_only_a_case_tagged_as_a_quirk_deviates() -> None:
    tags = {case["id"]: case["tags"] for case in CASES}
    assert all("quirk" in tags[case_id] for case_id in DEVIATIONS if case_id in tags)


def test_runner_prints_one_json_document_and_succeeds() -> None:
    command = [sys.executable, str(HERE / "conformance.py"), str(HERE / "cases" / "random"), "--json"]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stderr
    assert json.loads(finished.stdout) == {"cases": 50, "L1": 50, "L2": 50, "L3": 50, "L4": 50, "failed": []}


def test_runner_fails_and_names_the_level_of_a_wrong_trace(tmp_path: Path) -> None:
    case = json.loads((HERE / "cases" / "s01_sequence_index_memory.json").read_text())
    case["expected"]["steps"][1]["events"] = [["leaf", "running", "c"]]
    (tmp_path / "wrong.json").write_text(json.dumps(case))
    command = [sys.executable, str(HERE / "conformance.py"), str(tmp_path), "--json"]
    finished = subprocess.run(command, capture_output=True, text=True, check=False)
    summary = json.loads(finished.stdout)
    assert finished.returncode == 1
    assert [(f["id"], f["level"]) for f in summary["failed"]] == [("s01_sequence_index_memory", 2)]
    assert (summary["L1"], summary["L2"]) == (1, 0)
