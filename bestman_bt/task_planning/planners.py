"""Planners by name. They may be anybody's: one that fails, or returns what is no plan, is told with its name."""

from __future__ import annotations

import inspect

from bestman_bt.registry import PLANNERS, UnknownNameError
from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.symbolic import Action, PlanningError, Problem, TaskPlan


def planner_class(name: str) -> type[TaskPlanner]:
    """The class of a name; UnknownNameError, or PlanningError where it cannot be imported or is none."""
    try:
        found: object = PLANNERS.resolve(name)
    except UnknownNameError:
        raise
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"the planner {name!r} cannot be imported: {_words(error)}") from error
    if not inspect.isclass(found) or not issubclass(found, TaskPlanner):
        raise PlanningError(f"the planner {name!r} should be a subclass of TaskPlanner, got {found!r:.100}")
    return found


def made_planner(name: str) -> TaskPlanner:
    """A planner with its defaults; raises as ``planner_class``, also where it cannot be made."""
    made = planner_class(name)
    try:
        return made()
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"the planner {name!r} cannot be made: {_words(error)}") from error


def actions_of(planner: TaskPlanner, problem: Problem) -> tuple[Action, ...]:
    """What a planner plans; PlanningError where it fails or returns something else, beside those that it raises."""
    who = type(planner).__name__
    try:
        found: object = planner.plan(problem)
    except PlanningError:
        raise
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"{who} failed: {_words(error)}") from error
    if not isinstance(found, TaskPlan):
        raise PlanningError(f"{who} should return a TaskPlan, got {type(found).__name__}")
    actions: object = found.actions
    if not isinstance(actions, tuple) or not all(isinstance(action, Action) for action in actions):
        raise PlanningError(f"{who} should return a TaskPlan of a tuple of Action, got {actions!r:.100}")
    return actions


def _words(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
