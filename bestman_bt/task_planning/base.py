"""The interface of task planners."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.own_files import signature_fault

if TYPE_CHECKING:  # the planners in symbolic import this module
    from bestman_bt.task_planning.symbolic.problem import PlanningProblem, TaskPlan


class TaskPlanner(ABC):
    """Computes a plan for a problem; equal problems give equal plans."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Raises TypeError for a method that takes other arguments."""
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
