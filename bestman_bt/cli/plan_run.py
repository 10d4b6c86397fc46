"""The run of a planned tree, judged by the requested facts."""

from __future__ import annotations

import dataclasses
import sys
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from bestman_bt.cli.run_command import execute
from bestman_bt.configuration.run import RunConfig
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.result import RunResult
from bestman_bt.runtime.planning import PlanRequest, replanning_planner
from bestman_bt.runtime.task_goals import FactsFields, can_be_judged
from bestman_bt.task_planning.builders.plan_tree import PlanTree
from bestman_bt.task_planning.symbolic.problem import PlanningProblem

if TYPE_CHECKING:
    from bestman_bt.runtime.resolved_config import ResolvedConfig


def run_plan(question: PlanRequest, problem: PlanningProblem, made: PlanTree, planner: str, runs: Path) -> RunResult:
    """Run the tree in the planned scene; on failure, replan from the current beliefs. The language model is not called
    again: ``symbolic`` replans for its goal.
    """
    goal = " and ".join(map(str, problem.goal))
    asked = FactsFields(
        goal, question.given_places(problem), replanning_planner(planner), question.builder, question.limits.to_string()
    )
    xml = question.replanning_xml(made, problem, planner)
    runs.mkdir(parents=True, exist_ok=True)
    file = runs / f"{datetime.now().strftime('%Y%m%d-%H%M%S')}-plan.xml"
    file.write_text(xml, encoding="utf-8")
    result, _ = execute(prepare_episode(judged_by_goal(question.setup, problem, asked, file)), runs)
    return result


def judged_by_goal(setup: ResolvedConfig, problem: PlanningProblem, asked: FactsFields, tree: Path) -> RunConfig:
    """Return the run's configuration with the plan's goal instead of the task's, if any; reports facts that cannot

    be judged.
    """
    judged = sum(map(can_be_judged, problem.goal_literals))
    for literal in problem.goal_literals:
        if not can_be_judged(literal):
            print(f"{literal} cannot be judged: the result of the tree counts", file=sys.stderr)
    if judged < len(problem.goal):
        print(f"{judged} of {len(problem.goal)} facts of the goal are judged", file=sys.stderr)
    goals = ({"facts": dataclasses.asdict(asked)},)
    predicate = "facts" if judged else None
    own = setup.config.task
    task = dataclasses.replace(own, tree=str(tree), allowed_contacts=None, goals=goals, predicate=predicate)
    return dataclasses.replace(setup.config, name="plan", task=task)
