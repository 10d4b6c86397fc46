"""Planning from Python: from a scene and a goal to a verified tree."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

import bestman_bt as bt
from bestman_bt.configuration.errors import ConfigurationError
from bestman_bt.engine import load_tree
from bestman_bt.runtime.planning import PlannedTree
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic.problem import PlanningError, PlanningProblem, TaskPlan

PAGE = Path(__file__).resolve().parents[2] / "docs" / "task_planning.md"


def test_a_goal_in_a_scene_becomes_a_plan_and_a_tree() -> None:
    planned = bt.plan("on(cup, counter)", scene="kitchen", given=["on(cup, table)"])
    assert [str(action) for action in planned.plan.actions] == [
        "Search(cup, table/top)", "PickUp(cup, table/top)", "PutAt(cup, counter/top)",
    ]  # fmt: skip
    assert planned.problem.unmet_in(planned.problem.state) != ()
    assert load_tree(planned.xml, node_registry()).root.name == "as_planned_or_anew"


def test_what_a_planner_of_ones_own_returns_is_verified() -> None:
    class Forgets(TaskPlanner):
        def plan(self, problem: PlanningProblem) -> TaskPlan:
            return TaskPlan(())

    with pytest.raises(PlanningError, match=r"the plan of Forgets is refused: .*on\(cup, counter/top\) does not hold"):
        bt.plan("on(cup, counter)", scene="kitchen", planner=Forgets())


def test_facts_that_cannot_be_given_or_contradict_each_other_are_refused() -> None:
    for given, words in (
        (["holding(cup)"], r"holding\(cup\) cannot be given; on\(OBJECT, PLACE\) can"),
        (["on(cupp, table)"], "did you mean 'cup'"),
        (["on(cup, table)", "on(cup, counter)"], "cannot both be given"),
    ):
        with pytest.raises(ConfigurationError, match=words):
            bt.plan("on(cup, counter)", scene="kitchen", given=given)


def test_all_that_is_wrong_with_what_is_asked_is_reported_at_once() -> None:
    with pytest.raises(ConfigurationError) as refused:
        bt.plan(
            "on(cupp, countr) and foo(x)", scene="kitchen", planner="symbolix", builder="reactiv",
            limits="only=Pik", given=["on(cup, tabel)", "on(cup", "holding(cup)"],
        )  # fmt: skip
    told = [(problem.source, problem.message.partition(";")[0]) for problem in refused.value.problems]
    assert told == [
        ("planner", "unknown task planner 'symbolix'"),
        ("builder", "unknown tree builder 'reactiv'"),
        ("given", "column 7 of 'on(cup': ',' is expected, not the end"),
        ("given", "unknown place 'tabel'"),
        ("given", "holding(cup) cannot be given"),
        ("limits", "the limits name an unknown ability 'Pik'"),
        ("goal", "unknown object 'cupp'"),
        ("goal", "unknown place 'countr'"),
        ("goal", "unknown predicate 'foo'"),
    ]


def test_a_plan_is_printed_in_a_line() -> None:
    planned = bt.plan("on(cup, counter)", scene="kitchen", given=["on(cup, table)"])
    actions = "Search(cup, table/top); PickUp(cup, table/top); PutAt(cup, counter/top)"
    assert str(planned) == f"PlannedTree(on(cup, counter/top), in kitchen by diff_panda: {actions})"


def test_the_documented_planner_plans_from_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    section = PAGE.read_text(encoding="utf-8").partition("## Write a planner in 30 lines")[2]
    planner, script = re.findall(r"```python\n(.*?)```", section, re.DOTALL)[:2]
    (tmp_path / "my_planner.py").write_text(planner)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(PlannedTree, "run", lambda self: ran.append(self))
    ran: list[PlannedTree] = []
    exec(compile(script, PAGE.name, "exec"), {})
    sys.modules.pop("my_planner")
    assert capsys.readouterr().out.splitlines()[-1] == "PutAt(cup, counter/top)"
    assert len(ran) == 1


@pytest.mark.slow
def test_the_saved_tree_of_a_plan_that_only_hopes_does_what_was_asked() -> None:
    """The cup is on the table; the plan is to look for it on the counter."""
    planned = bt.plan("on(cup, counter)", scene="kitchen", seed=1)
    assert [action.name for action in planned.plan.actions] == ["Search"]
    assert planned.run().succeeded
