"""Fast Downward (Helmert, 2006) and other engines, through unified-planning, each in a separate process."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import Any

from bestman_bt.engine.own_files import describe_error
from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.pddl_writing import PddlText
from bestman_bt.task_planning.symbolic.problem import PlanningError, PlanningProblem, TaskPlan, Unsolvable


class PlannerMissingError(PlanningError, MissingExtraError):
    """The extra that a planner needs is not installed."""


@dataclass(frozen=True)
class FastDownwardPlanner(TaskPlanner):
    """Plans with an engine of unified-planning; extra ``planning``.

    ``engine``: of unified-planning: ``fast-downward`` finds a plan, ``fast-downward-opt`` the cheapest one.
    ``timeout``: seconds; a plan found earlier does not depend on it.
    """

    engine: str = "fast-downward"
    timeout: float = 60.0

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        """Return a plan. Raises the errors of ``TaskPlanner.plan``, and PlannerMissingError naming the extra."""
        problem.refuse_contradictory_goal()
        if not problem.unmet_in(problem.state):
            return TaskPlan(())
        planning = unified_planning(engine="up_fast_downward")
        text = PddlText(problem)
        try:
            stated = planning.io.PDDLReader().parse_problem_string(text.domain(), text.problem())
            with planning.shortcuts.OneshotPlanner(name=self.engine) as engine:
                result = engine.solve(stated, timeout=self.timeout)
        except Exception as error:  # of unified-planning or of the engine, which may raise anything
            raise PlanningError(
                f"{self.engine} of unified-planning raised {describe_error(error)}; "
                f"SymbolicPlanner(hand_over=0) plans without it"
            ) from error
        if result.plan is None:
            if "UNSOLVABLE" in result.status.name:
                unmet = problem.unmet_in(problem.state)
                raise Unsolvable(f"no plan leads to {' and '.join(map(str, unmet))}", unmet)
            raise PlanningError(f"{self.engine} found no plan: {result.status.name.lower()}")
        steps = (text.action(step.action.name, map(str, step.actual_parameters)) for step in result.plan.actions)
        return TaskPlan(tuple(instantiate(problem, operator, arguments) for operator, arguments in steps))


def is_valid(problem: PlanningProblem, plan: TaskPlan) -> bool:
    """Return whether unified-planning's own validator accepts a plan."""
    planning = unified_planning()
    text = PddlText(problem)
    stated = planning.io.PDDLReader().parse_problem_string(text.domain(), text.problem())
    steps = []
    for action in plan.actions:
        name, arguments = text.written(action)
        things = tuple(map(planning.shortcuts.ObjectExp, map(stated.object, arguments)))
        steps.append(planning.plans.ActionInstance(stated.action(name), things))
    with planning.shortcuts.PlanValidator(problem_kind=stated.kind) as validator:
        return bool(validator.validate(stated, planning.plans.SequentialPlan(steps)))


def unified_planning(engine: str = "") -> Any:
    """Import and return unified-planning. Raises PlannerMissingError if it, or ``engine``, is not installed."""
    try:
        import unified_planning
        import unified_planning.io
        import unified_planning.plans
        import unified_planning.shortcuts

        if engine:
            importlib.import_module(engine)
    except ModuleNotFoundError as error:
        raise PlannerMissingError(f"{error.name} is missing: {install_command('planning')}") from error
    environment = unified_planning.shortcuts.get_environment()
    environment.credits_stream = None
    environment.error_used_name = False  # in PDDL an action may be called as a predicate is
    return unified_planning
