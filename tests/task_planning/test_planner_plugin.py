"""The planner of the documentation, from a package of its own that is found by its entry point."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from bestman_bt.registry import Registry
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import Fact, Operator, PlanningProblem, Unsolvable

PAGE_FILE = Path(__file__).parents[2] / "docs" / "task_planning.md"
PAGE = PAGE_FILE.read_text(encoding="utf-8")


@pytest.fixture
def planner(tmp_path, monkeypatch) -> TaskPlanner:
    """As pip installs the package: its module, and the entry points of its pyproject.toml as metadata."""
    (program,) = re.findall(r"```python\n(from collections import deque.*?)```", PAGE, re.DOTALL)
    (group, name, target) = re.search(r'entry-points\."(.+?)"\]\n(\w+) = "(.+?)"', PAGE).groups()
    assert len(program.splitlines()) <= 30
    (tmp_path / "my_planner.py").write_text(program)
    metadata = tmp_path / "my_planner-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: my-planner\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[{group}]\n{name} = {target}\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    planners = Registry("bestman_bt.planners", "task planner", {})
    assert "breadth_first" in planners.names()
    yield planners.resolve("breadth_first")()
    sys.modules.pop("my_planner")


def steps(goal: str) -> PlanningProblem:
    operators = tuple(
        Operator(f"Step{number}", add=(Fact(f"at{number + 1}"),), pre=parse_literals(f"at{number}"))
        for number in range(3)
    )
    return PlanningProblem({}, frozenset({Fact("at0")}), parse_literals(goal), operators)


def test_a_planner_of_another_package_is_found_and_plans(planner):
    assert [str(action) for action in planner.plan(steps("at2")).actions] == ["Step0()", "Step1()"]


def test_it_reports_when_there_is_no_plan(planner):
    with pytest.raises(Unsolvable):
        planner.plan(steps("at2 and not at0"))


@pytest.mark.slow
def test_the_command_plans_with_it(planner, tmp_path):
    (tmp_path / "world.yaml").write_text(
        "scene: kitchen\nbeliefs:\n  objects:\n"
        "    cup: {what: {model: cup}, surface: table/top, pose: {position: [3.1, -0.2, 80 cm]}}\n"
    )
    arguments = ["plan", "--goal", "on(cup, counter)", "--world", "world.yaml", "--planner", "breadth_first"]
    done = subprocess.run(
        [sys.executable, "-m", "bestman_bt.cli.main", *arguments],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(PAGE_FILE.parents[1]), str(tmp_path)])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-2:] == ["  1. PickUp(cup, table/top)", "  2. PutAt(cup, counter/top)"]
