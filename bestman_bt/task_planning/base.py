"""The interface of task planners, and planners by name."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.own_files import describe_error, signature_fault
from bestman_bt.registry import PLANNERS, UnknownNameError
from bestman_bt.task_planning.symbolic.problem import Action, PlanningError, PlanningProblem, TaskPlan

if TYPE_CHECKING:
    from bestman_bt.task_planning.symbolic.problem import PlanningProblem, TaskPlan


class TaskPlanner(ABC):
    """Computes a plan for a problem; equal problems give equal plans."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Check the signature. Raises TypeError for a method that takes other arguments."""
        super().__init_subclass__(**options)
        if fault := signature_fault(cls, TaskPlanner):
            raise TypeError(fault)

    @abstractmethod
    def plan(self, problem: PlanningProblem) -> TaskPlan:
        """Return actions that lead from the problem's state to its goal; an empty plan if the goal holds already.

        Raises:
            Unsolvable: there is no plan.
            GoalError: the goal is invalid.
            PlanningError: the planner failed.
        """


def planner_class(name: str) -> type[TaskPlanner]:
    """Return the class of a name. Raises UnknownNameError, or PlanningError if it is not a planner or cannot be
    imported.
    """
    try:
        found: object = PLANNERS.resolve(name)
    except UnknownNameError:
        raise
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"the planner {name!r} cannot be imported: {describe_error(error)}") from error
    if not inspect.isclass(found) or not issubclass(found, TaskPlanner):
        raise PlanningError(f"the planner {name!r} should be a subclass of TaskPlanner, got {found!r:.100}")
    return found


def made_planner(name: str) -> TaskPlanner:
    """Return a planner with its defaults. Raises UnknownNameError, or PlanningError if it is not a planner or cannot be
    created.
    """
    made = planner_class(name)
    try:
        return made()
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"the planner {name!r} cannot be made: {describe_error(error)}") from error


def actions_of(planner: TaskPlanner, problem: PlanningProblem) -> tuple[Action, ...]:
    """Return the actions of a planner. Raises PlanningError if it fails or returns something else."""
    who = type(planner).__name__
    try:
        found: object = planner.plan(problem)
    except PlanningError:
        raise
    except (Exception, SystemExit) as error:  # of a third party: whatever it is, the run goes on
        raise PlanningError(f"{who} failed: {describe_error(error)}") from error
    if not isinstance(found, TaskPlan):
        raise PlanningError(f"{who} should return a TaskPlan, got {type(found).__name__}")
    actions: object = found.actions
    if not isinstance(actions, tuple) or not all(isinstance(action, Action) for action in actions):
        raise PlanningError(f"{who} should return a TaskPlan of a tuple of Action, got {actions!r:.100}")
    return actions
