"""Every recorded case passes, in every mode of listening."""

from __future__ import annotations

import importlib.util
import itertools
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from bestman_bt.engine import TreeLoadError
from bestman_bt.engine.models.scenario import Scenario
from bestman_bt.engine.simulation import simulate

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


@pytest.mark.slow
def test_each_case_passes_through_simulate_up_to_its_first_change_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner._Recorded, "emit", lambda node, *event: node.context.append([*event]))
    differences, ended = {}, 0
    for case in CASES:
        steps = case.get("steps") or [{"op": "tick"}] * runner.MAX_TICKS
        sets = list(itertools.takewhile(lambda step: step["op"] == "set", steps))
        ticks = len(list(itertools.takewhile(lambda step: step["op"] == "tick", steps[len(sets) :])))
        wanted = case["expected"].get("steps", [])[len(sets) : len(sets) + ticks]
        known = case["id"] in DEVIATIONS or "async_timer" in case["tags"] or "external_blackboard" in case
        if known or not wanted or any("error" in step for step in wanted):
            continue
        last = next((i for i, step in enumerate(wanted) if step["returned"] != "RUNNING"), len(wanted) - 1)
        events: list[list] = []
        rules = case.get("substitutions")
        run = simulate(
            case["xml"], runner.registry_of_cases(case.get("enums")), context=events, period=1e-6,
            limit=max(last - 0.5, 0.5) * 1e-6, entries={step["key"]: step["value"] for step in sets},
            substitutions=runner.SubstitutionRules.from_json(rules) if rules else None,
        )  # fmt: skip
        leaves = [event for step in wanted[: last + 1] for event in step["events"] if event[0] != "status"]
        got: tuple = (events[: len(leaves)],)
        expected: tuple = (leaves,)
        if wanted[last]["returned"] != "RUNNING":
            ended += 1
            got += (runner.status_name(run.status), run.ticks)
            expected += (wanted[last]["returned"], last + 1)
        if got != expected:
            differences[case["id"]] = (got, expected)
    assert not differences
    assert ended > 100


def test_each_case_that_loads_is_simulated_without_its_leaves() -> None:
    for case in CASES:
        try:
            run = simulate(case["xml"], scenario=Scenario(enums=case.get("enums") or {}), limit=5.0)
        except TreeLoadError:
            assert "load_error" in case["expected"] or case["id"] in DEVIATIONS, case["id"]
        else:
            assert run.ticks or run.error, case["id"]
