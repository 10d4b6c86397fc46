"""Back-chaining: each condition has a fallback with the action that achieves it.

M. Colledanchise, D. Almeida, P. Ögren, "Towards Blended Reactive Planning and Acting using Behavior Trees" (PA-BT),
ICRA 2019. Expanded along the causal links of a plan instead of at run time.
"""

from __future__ import annotations

from collections import defaultdict
from copy import deepcopy
from dataclasses import dataclass

from bestman_bt.engine import XmlElement
from bestman_bt.engine.xml.elements import MAX_DEPTH
from bestman_bt.task_planning.builders.base import TreeBuilder
from bestman_bt.task_planning.builders.plan_tree import Writer, sequential_steps
from bestman_bt.task_planning.builders.regression import kernels
from bestman_bt.task_planning.symbolic.problem import Literal, PlanningError, TaskPlan

MAX_ACTIONS = 2000
"""Largest number of action nodes in one tree: an action is repeated wherever a condition needs it."""
MAX_NESTED = 118
"""Largest number of nested actions, two levels each, so that a tree with shipped abilities has at most
``MAX_DEPTH``.
"""


@dataclass(frozen=True)
class BackchainBuilder(TreeBuilder):
    """For each goal: check it, else execute the action that achieves it, after treating its preconditions alike.

    An action comes directly before the action that needs it, so the order of the tree can differ from that of the plan.
    Where an action would then undo a condition that is established to its left, or where its own preconditions need not
    hold any longer, it is moved to the left, as in PA-BT: it becomes a child of the root, before all later actions of
    the plan, and is executed unless all of its effects that the plan uses hold. Undisturbed, the tree reaches the goal
    from each state from which the plan does.

    A precondition that was true when planning has no fallback: if it is violated, the tree fails. As in ``reactive``, a
    running action is completed while its hold-conditions are believed.

    ``attempts``: number of restarts of the tree after a failure.
    """

    attempts: int = 3

    def root(self, plan: TaskPlan, goal: tuple[Literal, ...], writer: Writer) -> XmlElement:
        """Return retries around the sequence of goals. Raises PlanningError for a plan that undoes what it needs."""
        moved: frozenset[int] = frozenset()
        while True:
            chain = _Chain(plan, goal, moved, deepcopy(writer))
            try:
                goals = chain.conditions(len(plan.actions))
            except _Conflict as conflict:
                if conflict.moved <= moved:
                    raise  # each round has to move another action
                moved = conflict.moved
                continue
            goals.append(chain.writer.holds("goal_reached", goal))
            attempt = chain.writer.node("Sequence", "reach_the_goal", goals)
            return chain.writer.node("RetryUntilSuccessful", "attempts", [attempt], num_attempts=str(self.attempts))


class _Conflict(PlanningError):
    """The conditions of an action need not hold at its place in the tree. ``moved``: the actions to move to the
    left.
    """

    def __init__(self, who: str, literal: Literal, moved: frozenset[int]) -> None:
        super().__init__(
            f"{who} needs {literal}, which an action before it in the tree may undo; use the builder 'reactive'"
        )
        self.moved = moved


class _Chain:
    """Writes the nodes in the order of their execution.

    ``known``: the literals that hold at that point, whichever actions were skipped. ``lost_by``: the last action that
    has undone a literal. ``moved``: the actions that are children of the root.
    """

    def __init__(self, plan: TaskPlan, goal: tuple[Literal, ...], moved: frozenset[int], writer: Writer) -> None:
        self.actions = plan.actions
        self.needs = [*(action.pre for action in plan.actions), frozenset(goal)]
        self.links = [self._links(number) for number in range(len(self.needs))]
        self.known = kernels(sequential_steps(plan), goal)[0]
        self.lost_by: dict[Literal, int] = {}
        self.moved = moved
        self.writer = writer
        self.count = self.nested = 0

    def conditions(self, before: int) -> list[XmlElement]:
        """Return the conditions of the action ``before``, or of the goal, each with the action that achieves it, in the
        order of the plan. Raises _Conflict if they need not hold afterwards.
        """
        needs, elements = self.needs[before], list[XmlElement]()
        links = dict(self.links[before])
        if before == len(self.actions):
            for action in self.moved:
                links[action] = frozenset().union(*(each.get(action, ()) for each in self.links))
        holding = needs & self.known
        for producer, wanted in sorted(links.items()):
            if producer >= 0 and not wanted <= self.known:
                elements.append(self._unless_done(producer, wanted))
                holding = (holding & self.known) - wanted
        for literal in sorted(needs - self.known):
            who = str(self.actions[before]) if before < len(self.actions) else "the goal"
            raise _Conflict(who, literal, self._moved_too(literal, before))
        if holding:
            elements.insert(0, self.writer.holds(f"{before + 1}_can_be_done", holding))
        return elements

    def _unless_done(self, index: int, wanted: frozenset[Literal]) -> XmlElement:
        before = self.known
        holds = self.writer.holds(f"{index + 1}_is_done", wanted)
        if len(wanted - before) == 1:
            self.known |= {~literal for literal in wanted - before}
        node = self.writer.node("Fallback", f"{index + 1}_unless_done", [holds, self._do(index)])
        if not any(~literal in before for literal in wanted):
            self.known &= before | wanted
        return node

    def _do(self, index: int) -> XmlElement:
        self.count += 1
        if self.count > MAX_ACTIONS:
            raise PlanningError(
                f"the tree would have more than {MAX_ACTIONS} actions; the builder 'reactive' needs one per action"
            )
        self.nested += 1
        if self.nested > MAX_NESTED:
            raise PlanningError(
                f"more than {MAX_NESTED} actions would be nested, but a tree has at most {MAX_DEPTH} levels; use the "
                "builder 'reactive', which needs one level per action, or 'sequence', which nests none"
            )
        action = self.actions[index]
        children = self.conditions(index)
        self.nested -= 1
        if len(children) > 1:  # what was brought about first may have been undone by what came after it
            children.append(self.writer.holds(f"{index + 1}_is_ready", action.pre))
        undone = {~effect for effect in action.effects} & self.known
        self.lost_by |= dict.fromkeys(undone, index)
        self.known = (self.known - undone) | action.effects
        return self.writer.node("Sequence", f"{index + 1}_do", [*children, self.writer.action(index + 1, action)])

    def _links(self, before: int) -> dict[int, frozenset[Literal]]:
        """Return the literals that ``before`` needs from each earlier action of the plan, by its number; -1: from the
        initial state.
        """
        found = defaultdict[int, set[Literal]](set)
        for literal in self.needs[before]:
            found[self._producer(literal, before)].add(literal)
        return {producer: frozenset(wanted) for producer, wanted in found.items()}

    def _producer(self, literal: Literal, before: int) -> int:
        return next((i for i in reversed(range(before)) if literal in self.actions[i].effects), -1)

    def _moved_too(self, literal: Literal, before: int) -> frozenset[int]:
        """Return the actions to move so that ``literal`` holds for ``before``.

        These are the ones moved so far and the one that undid the literal, or ``before`` itself; all actions if that
        one was moved already, or is the goal.
        """
        culprit = self.lost_by.get(literal, before)
        if culprit >= self._producer(literal, before):
            culprit = before
        every = frozenset(range(len(self.actions)))
        return every if culprit in self.moved or culprit not in every else self.moved | {culprit}
