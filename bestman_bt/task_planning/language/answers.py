"""Checks of answers before they become a tree: the goal is valid, the steps are feasible and reach it within the
limits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bestman_bt.facts.located import UNSEEN
from bestman_bt.facts.on import ON
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.language.conversation import FaultyAnswerError
from bestman_bt.task_planning.language.schema import GoalAnswer, PlanAnswer
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic.grounding import ground, instantiate
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    GoalError,
    Literal,
    PlanningError,
    PlanningProblem,
    TaskPlan,
)
from bestman_bt.task_planning.symbolic.search import without_needless


def checked_goal(problem: PlanningProblem, answer: GoalAnswer) -> PlanningProblem:
    """Return the problem with the goal of the answer, unless it has its own; given places restrict unseen things.

    Raises FaultyAnswerError.
    """
    if problem.goal:
        return problem
    goal, faults = _facts(problem, "goal", answer.goal)
    told, faults_of_told = _facts(problem, "told", answer.told)
    faults += faults_of_told
    no_place = [literal for literal in told if literal.negated or literal.fact.predicate != ON.name]
    faults += [f"told: {literal} does not say where a thing is" for literal in no_place]
    if not goal and not faults:
        faults.append("goal: empty; say as facts what shall hold at the end, or give a refusal")
    try:
        Domain(()).refuse_contradictions(goal)
    except GoalError as error:
        faults.append(f"goal: {error}")
    if faults:
        raise FaultyAnswerError(faults)
    state = problem.state - _ruled_out(problem, [literal.fact for literal in told])
    return replace(problem, goal=tuple(dict.fromkeys(goal)), state=state)


def _facts(problem: PlanningProblem, field: str, texts: Sequence[str]) -> tuple[list[Literal], list[str]]:
    """Return the facts in the texts with full names, and the faults."""
    domain = Domain(())
    literals: list[Literal] = []
    faults: list[str] = []
    for number, text in enumerate(texts):
        try:
            literals += domain.with_goal(problem, text).goal
        except GoalError as error:
            faults.append(f"{field}[{number}]: {error}")
    return literals, faults


def _ruled_out(problem: PlanningProblem, told: Sequence[Fact]) -> set[Fact]:
    """Return the facts excluded by given places of unseen things; places that were searched do not count."""
    places: dict[str, set[str]] = {}
    for fact in told:
        name, place = fact.arguments
        if Fact(UNSEEN.name, (name, place)) in problem.state:
            places.setdefault(name, set()).add(place)
    return {
        fact
        for fact in problem.state
        if fact.predicate == UNSEEN.name and fact.arguments[1] not in places.get(fact.arguments[0], fact.arguments)
    }


def checked_plan(problem: PlanningProblem, limits: PlanLimits, answer: PlanAnswer) -> tuple[PlanningProblem, TaskPlan]:
    """Return the problem with its goal, and the plan without unnecessary steps. Raises FaultyAnswerError."""
    problem = checked_goal(problem, answer)
    operators = {operator.name: operator for operator in limits.operators(problem)}
    try:
        actions = [instantiate(problem, operators[step.ability], step.values) for step in answer.plan]
        faults = limits.faults(actions) or _run_through(problem, actions)
        if not faults:
            return problem, TaskPlan(_needed(problem, actions))
    except PlanningError as error:
        faults = [str(error)]
    raise FaultyAnswerError(faults)


def _run_through(problem: PlanningProblem, actions: Sequence[Action]) -> list[str]:
    """Do the steps in thought, up to the first that cannot be done or leads back to where the plan has been."""
    state = problem.state
    been = {state: "the start"}
    for number, action in enumerate(actions, start=1):
        broken = action.broken_in(state)
        if broken:
            return [f"step {number}, {action}: it needs {' and '.join(map(str, broken))}, which does not hold then"]
        state = action.applied_to(state)
        if state in been:
            return [f"step {number}, {action}: all is then as after {been[state]}; leave out what goes in a circle"]
        been[state] = f"step {number}, {action}"
    unmet = problem.unmet_in(state)
    after = "the plan is empty, and" if not actions else "after the last step"
    return [f"{after} the goal's {' and '.join(map(str, unmet))} does not hold"] if unmet else []


def _needed(problem: PlanningProblem, actions: Sequence[Action]) -> tuple[Action, ...]:
    """Return the steps without those that the goal does not need."""
    grounded = ground(problem)
    numbers = {action: number for number, action in enumerate(grounded.actions)}
    kept = without_needless(grounded, [numbers[action] for action in actions])
    return tuple(grounded.actions[number] for number in kept)
