"""Reactive plan execution by regressed kernels: before each action the tree determines the remaining steps."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.engine import XmlElement
from bestman_bt.engine.xml.elements import MAX_DEPTH
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import Writer, parallel_steps, sequential_steps
from bestman_bt.task_planning.builders.regression import ready_steps
from bestman_bt.task_planning.symbolic.problem import Literal, PlanningError, TaskPlan

MAX_STEPS = 233
"""Largest number of steps, one level each, so that a tree with shipped abilities has at most ``MAX_DEPTH`` levels."""


@dataclass(frozen=True)
class ReactiveBuilder(TreeBuilder):
    """PLANEX (Fikes, Hart, Nilsson 1972) as a behavior tree.

    In each round it executes the latest plan step whose conditions hold, given that later steps may be skipped. It thus
    skips steps whose effects hold already or are not needed, repeats steps that were undone, and fails if no step
    helps: then another plan is needed. It checks between actions and not during one, because effects appear before an
    action is finished (an object is held before the arm is back); hold-conditions are checked at each tick.

    ``attempts``: failed actions after which the tree fails. ``rounds``: largest number of actions, per step.
    ``most_ways``: alternatives to check before a step. ``parallel``: run independent actions of different parts in
    parallel.
    """

    attempts: int = 3
    rounds: int = 4
    most_ways: int = 8
    parallel: bool = True

    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return retries around rounds; a round is a chain of IfThenElse nodes that checks the last step first."""
        steps = parallel_steps(plan) if self.parallel else sequential_steps(plan)
        if len(steps) > MAX_STEPS:
            raise PlanningError(
                f"the plan has {len(steps)} steps, but a tree has at most {MAX_DEPTH} levels and 'reactive' needs one "
                f"per step, for at most {MAX_STEPS}; use the builder 'sequence', which nests none"
            )
        otherwise = writer.node("AlwaysFailure", "no_step_is_ready")
        for number, (step, ways) in enumerate(ready_steps(steps, goal, self.most_ways), 1):
            if ways:
                ready = writer.any_of(f"{number}_is_ready", ways)
                otherwise = writer.node(
                    "IfThenElse", f"{number}_if_ready", [ready, writer.step(number, step), otherwise]
                )
        a_round = writer.node(
            "Fallback",
            "done_or_stuck",
            [writer.holds("goal", goal), writer.node("Inverter", "on_unless_it_fails", [otherwise])],
        )
        rounds = writer.node(
            "RetryUntilSuccessful", "round_by_round", [a_round], num_attempts=str(self.rounds * len(steps))
        )
        attempt = writer.node("Sequence", "reach_the_goal", [rounds, writer.holds("goal_reached", goal)])
        return writer.node("RetryUntilSuccessful", "attempts", [attempt], num_attempts=str(self.attempts))
