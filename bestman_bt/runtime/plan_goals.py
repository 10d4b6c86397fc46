"""What a task asks of planners in one world: facts, and what somebody said of where things are."""

from __future__ import annotations

from collections.abc import Iterator

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.engine import NodeRegistry
from bestman_bt.registry import BUILDERS, PLANNERS, suggestion
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.predicates import Beliefs, surfaces
from bestman_bt.task_planning.symbolic import GoalError, Literal
from bestman_bt.world_model import SemanticMap, WorldModel


def plan_goal(config: RunConfig, registry: NodeRegistry, known: WorldModel) -> tuple[Literal, ...]:
    """The facts of the task's plan, with the full names of things; none without one. GoalError for bad ones."""
    asked = config.task.plan
    if asked is None:
        return ()
    return Domain.of(registry).problem(Beliefs(known.as_at_the_start()), asked.goal).goal


def told_of_plan(config: RunConfig, known: SemanticMap) -> dict[str, str]:
    """Object → surface, by its full name, where the plan's task says that it is."""
    told = config.task.plan.told if config.task.plan is not None else {}
    found = {}
    for name, place in told.items():
        furniture, surface = known.surface(place)
        found[name] = f"{furniture.name}/{surface.name}"
    return found


def plan_problems(config: RunConfig, registry: NodeRegistry, known: WorldModel) -> Iterator[Problem]:
    """A goal that makes no sense here, and unknown names."""
    asked = config.task.plan
    if asked is None:
        return
    try:
        plan_goal(config, registry, known)
    except GoalError as error:
        yield config.problem(("plan", "goal"), str(error))
    for field, registered in (("planner", PLANNERS), ("builder", BUILDERS)):
        name = getattr(asked, field)
        if name not in registered.names():
            yield config.problem(("plan", field), f"unknown {field} {name!r}; {suggestion(name, registered.names())}")
    try:
        PlanLimits.from_string(asked.limits)
    except ValueError as error:
        yield config.problem(("plan", "limits"), str(error))
    places = [*known.map.furniture, *surfaces(known)]
    for name, place in asked.told.items():
        if name not in known.models:
            message = f"the robot knows no object {name!r}; {suggestion(name, list(known.models))}"
            yield config.problem(("plan", "told", name), message)
        if place not in places:
            yield config.problem(
                ("plan", "told", name), f"the map has no surface {place!r}; {suggestion(place, places)}"
            )
