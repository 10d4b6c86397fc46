"""Back-chaining: each condition has a fallback with the action that achieves it.

M. Colledanchise, D. Almeida, P. Ögren, "Towards Blended Reactive Planning and Acting using Behavior Trees" (PA-BT),
ICRA 2019. Expanded along the causal links of a plan instead of at run time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

from bestman_bt.engine import XmlElement
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import Writer
from bestman_bt.task_planning.symbolic.problem import Action, Literal, PlanningError, TaskPlan

MAX_ACTIONS = 2000
"""Most action nodes in one tree: an action stands wherever something needs it."""


@dataclass(frozen=True)
class BackchainBuilder(TreeBuilder):
    """For each goal: check it, else execute the action that achieves it, after treating its preconditions alike.

    A precondition that was true when planning has no fallback: if it is violated, the tree fails. As in ``reactive``, a
    running action is completed while its hold-conditions are believed.

    Limit: an action is left out where the effect that it is for holds already. If something needs another effect of it
    later, the tree can fail, even in the state that was planned for. ``reactive`` does not have this limit.

    ``attempts``: number of restarts of the tree after a failure.
    """

    attempts: int = 3

    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return retries around the sequence of goals."""
        chain = _Chain(plan.actions, writer)
        goals = chain.conditions(goal, len(plan.actions), frozenset())
        attempt = writer.node("Sequence", "reach_the_goal", [*goals, writer.holds("goal_reached", goal)])
        return writer.node("RetryUntilSuccessful", "attempts", [attempt], num_attempts=str(self.attempts))


class _Chain:
    def __init__(self, actions: tuple[Action, ...], writer: Writer) -> None:
        self.actions = actions
        self.effects = [action.effects for action in actions]
        self.writer = writer
        self.count = 0

    def conditions(self, literals: Iterable[Literal], before: int, given: frozenset[Literal]) -> list[XmlElement]:
        """Return the conditions of the action ``before``, each with what brings it about, in the order of the plan.

        ``given``: holds whenever these are asked, for it has been asked to the left.
        """
        elements = []
        for producer, wanted in sorted(self._by_producer(literals, before, given).items()):
            name = f"{producer + 1}_is_done" if producer >= 0 else f"{before + 1}_can_be_done"
            holds = self.writer.holds(name, wanted)
            if producer < 0:
                elements.append(holds)
                continue
            elements.append(
                self.writer.node("Fallback", f"{producer + 1}_unless_done", [holds, self._do(producer, given)])
            )
            given = (given - self._touched(producer)) | wanted
        return elements

    def _do(self, index: int, given: frozenset[Literal]) -> XmlElement:
        self.count += 1
        if self.count > MAX_ACTIONS:
            raise PlanningError(
                f"the tree would have more than {MAX_ACTIONS} actions; the builder 'reactive' needs one per action"
            )
        action = self.actions[index]
        children = self.conditions(action.pre, index, given)
        if len(children) > 1:  # what was brought about first may have been undone by what came after it
            children.append(self.writer.holds(f"{index + 1}_is_ready", action.pre))
        return self.writer.node("Sequence", f"{index + 1}_do", [*children, self.writer.action(index + 1, action)])

    def _by_producer(
        self, literals: Iterable[Literal], before: int, given: frozenset[Literal]
    ) -> dict[int, frozenset[Literal]]:
        """Return which action of the plan each literal comes from; -1: no action is needed for it here.

        These are literals that held from the start, are given, or come from an action of which another effect is given.
        """
        found: dict[int, set[Literal]] = defaultdict(set)
        for literal in literals:
            producer = next((i for i in reversed(range(before)) if literal in self.effects[i]), -1)
            found[-1 if literal in given or self.effects[producer] & given else producer].add(literal)
        return {producer: frozenset(wanted) for producer, wanted in found.items()}

    def _touched(self, last: int) -> frozenset[Literal]:
        """Return the facts that actions up to ``last`` may undo."""
        return frozenset(~effect for effects in self.effects[: last + 1] for effect in effects)
