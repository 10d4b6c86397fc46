"""How a tree that was just planned is judged when it is run at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from bestman_bt.cli.plan_run import judged_by_goal
from bestman_bt.configuration.run import RunConfig, RunRequest
from bestman_bt.runtime.planning import PlanRequest, Transcript, planning_state
from bestman_bt.runtime.task_goals import FactsFields
from bestman_bt.task_planning.limits import PlanLimits


@pytest.fixture(scope="module")
def question() -> PlanRequest:
    setup, beliefs = planning_state(RunRequest("open_drawer"))
    return PlanRequest(setup, beliefs, "reactive", PlanLimits())


def judged(question: PlanRequest, goal: str) -> RunConfig:
    problem, _ = question.answer(None, goal, "symbolic", Transcript())
    return judged_by_goal(question.setup, problem, FactsFields(goal), Path("plan.xml"))


def test_the_goals_facts_take_the_place_of_what_the_task_asks_for(question: PlanRequest) -> None:
    assert question.setup.config.task.asked("opened") is not None
    task = judged(question, "open(drawer_2)").task
    assert (task.predicates, task.tree) == (("facts",), "plan.xml")
    assert [list(goal) for goal in task.goals] == [["facts"]]
    assert task.goals[0]["facts"]["goal"] == "open(drawer_2)"


def test_what_the_plans_skills_declare_may_be_touched_whatever_the_task_would_allow(question: PlanRequest) -> None:
    assert question.setup.config.task.allowed_contacts
    assert judged(question, "open(drawer_2)").task.allowed_contacts is None


def test_of_facts_about_the_robot_alone_the_trees_word_counts(
    question: PlanRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    assert judged(question, "near(drawer_chest/top) and open(drawer_2)").task.predicates == ("facts",)
    told = capsys.readouterr().err
    assert "near(drawer_chest/top) cannot be judged" in told
    assert "1 of 2 facts of the goal are judged" in told
    assert judged(question, "near(drawer_chest/top)").task.predicates == ()
