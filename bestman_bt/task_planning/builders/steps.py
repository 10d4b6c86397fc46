"""A plan as steps: actions that keep different parts of the robot busy and do not touch each other go side by side."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.task_planning.symbolic.problem import Action, Fact, Literal, TaskPlan


@dataclass(frozen=True)
class PlanStep:
    """What is done at a time: one action, or several that are independent of each other."""

    actions: tuple[Action, ...]

    def __str__(self) -> str:
        return " beside ".join(str(action) for action in self.actions)

    @property
    def pre(self) -> frozenset[Literal]:
        """What must hold before it."""
        return frozenset().union(*(action.pre for action in self.actions))

    @property
    def effects(self) -> frozenset[Literal]:
        """What holds after it because of it."""
        return frozenset().union(*(action.effects for action in self.actions))

    @property
    def alone(self) -> tuple[PlanStep, ...]:
        """Each of several actions as a step of its own, for when the others are done; none of a single one."""
        return tuple(PlanStep((action,)) for action in self.actions) if len(self.actions) > 1 else ()


def steps_one_by_one(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Each action is a step of its own."""
    return tuple(PlanStep((action,)) for action in plan.actions)


def steps_side_by_side(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Each action goes into the earliest step before which everything that it depends on is done.

    The order of any two actions that depend on each other, or need the same part, stays that of the plan.
    """
    steps: list[list[Action]] = []
    for action in plan.actions:
        last = max((i for i, step in enumerate(steps) if any(depend(other, action) for other in step)), default=-1)
        if last + 1 == len(steps):
            steps.append([])
        steps[last + 1].append(action)
    return tuple(PlanStep(tuple(step)) for step in steps)


def depend(first: Action, second: Action) -> bool:
    """Return whether the order of two actions matters; an action that names no part may need any."""
    if not first.parts or not second.parts or set(first.parts) & set(second.parts):
        return True
    changes, needs = _changed(first), _needed(first)
    return bool(changes & (_changed(second) | _needed(second)) or needs & _changed(second))


def _changed(action: Action) -> frozenset[Fact]:
    return action.add | action.delete


def _needed(action: Action) -> frozenset[Fact]:
    return frozenset(literal.fact for literal in action.pre)
