"""What every task planner offers, whatever it plans with."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the planners in symbolic import this module
    from bestman_bt.task_planning.symbolic.problem import Problem, TaskPlan


class TaskPlanner(ABC):
    """From a problem to a plan; equal problems give equal plans."""

    @abstractmethod
    def plan(self, problem: Problem) -> TaskPlan:
        """Actions that lead from the problem's state to its goal; none where it holds already.

        Raises Unsolvable where there is no plan, GoalError where the goal makes no sense, PlanningError else.
        """
