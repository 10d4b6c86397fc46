"""Symbolic planning: facts, problems, and a planner for them."""

from bestman_bt.task_planning.symbolic.facts import (
    FactSyntaxError,
    goal_as_facts,
    parse_conditions,
    parse_fact,
    parse_goal,
    parse_literals,
)
from bestman_bt.task_planning.symbolic.grounding import ground, instantiate, reachable_actions
from bestman_bt.task_planning.symbolic.pddl_reading import PddlError, read_pddl
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Condition,
    Fact,
    Forall,
    GoalError,
    GoalFaults,
    Literal,
    Operator,
    PlanningError,
    Problem,
    TaskPlan,
    Unsolvable,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner

__all__ = [
    "Action",
    "Condition",
    "Fact",
    "FactSyntaxError",
    "Forall",
    "GoalError",
    "GoalFaults",
    "Literal",
    "Operator",
    "PddlError",
    "PlanningError",
    "Problem",
    "SymbolicPlanner",
    "TaskPlan",
    "Unsolvable",
    "goal_as_facts",
    "ground",
    "instantiate",
    "parse_conditions",
    "parse_fact",
    "parse_goal",
    "parse_literals",
    "reachable_actions",
    "read_pddl",
]
