"""What every task planner offers, whatever it plans with."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from bestman_bt.engine.own_files import signature_fault

if TYPE_CHECKING:  # the planners in symbolic import this module
    from bestman_bt.task_planning.symbolic.problem import Problem, TaskPlan


class TaskPlanner(ABC):
    """From a problem to a plan; equal problems give equal plans."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Raises TypeError for a method that takes other arguments."""
        super().__init_subclass__(**options)
        if fault := signature_fault(cls, TaskPlanner):
            raise TypeError(fault)

    @abstractmethod
    def plan(self, problem: Problem) -> TaskPlan:
        """Actions that lead from the problem's state to its goal; none where it holds already.

        Raises Unsolvable where there is no plan, GoalError where the goal makes no sense, PlanningError else.
        """
