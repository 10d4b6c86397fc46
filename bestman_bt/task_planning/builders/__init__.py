"""From plans to behavior trees."""

from bestman_bt.task_planning.builders.backchain import BackchainBuilder
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import PlanTree
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.builders.regression import Ready, kernels, staircase
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.task_planning.builders.steps import PlanStep, steps_one_by_one, steps_side_by_side

__all__ = [
    "BackchainBuilder",
    "PlanStep",
    "PlanTree",
    "ReactiveBuilder",
    "Ready",
    "SequenceBuilder",
    "TreeBuilder",
    "kernels",
    "staircase",
    "steps_one_by_one",
    "steps_side_by_side",
]
