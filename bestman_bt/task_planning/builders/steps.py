"""Plans as steps: independent actions that use different parts of the robot run in parallel."""

from __future__ import annotations

from dataclasses import dataclass

from bestman_bt.task_planning.symbolic.problem import Action, Fact, Literal, TaskPlan


@dataclass(frozen=True)
class PlanStep:
    """One action, or several independent ones in parallel."""

    actions: tuple[Action, ...]

    def __str__(self) -> str:
        return " beside ".join(str(action) for action in self.actions)

    @property
    def pre(self) -> frozenset[Literal]:
        """The preconditions of the step."""
        return frozenset().union(*(action.pre for action in self.actions))

    @property
    def effects(self) -> frozenset[Literal]:
        """The effects of the step."""
        return frozenset().union(*(action.effects for action in self.actions))

    @property
    def alone(self) -> tuple[PlanStep, ...]:
        """The actions of a parallel step as separate steps, used when the other actions are done; empty for one
        action.
        """
        return tuple(PlanStep((action,)) for action in self.actions) if len(self.actions) > 1 else ()


def steps_one_by_one(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Return each action as a step."""
    return tuple(PlanStep((action,)) for action in plan.actions)


def steps_side_by_side(plan: TaskPlan) -> tuple[PlanStep, ...]:
    """Return steps in which each action is placed after everything that it depends on, as early as possible.

    Two actions that depend on each other, or use the same part, keep their order.
    """
    steps: list[list[Action]] = []
    for action in plan.actions:
        last = max((i for i, step in enumerate(steps) if any(depend(other, action) for other in step)), default=-1)
        if last + 1 == len(steps):
            steps.append([])
        steps[last + 1].append(action)
    return tuple(PlanStep(tuple(step)) for step in steps)


def depend(first: Action, second: Action) -> bool:
    """Return whether the order of two actions matters; an action without declared parts may use any."""
    if not first.parts or not second.parts or set(first.parts) & set(second.parts):
        return True
    changes, needs = _changed(first), _needed(first)
    return bool(changes & (_changed(second) | _needed(second)) or needs & _changed(second))


def _changed(action: Action) -> frozenset[Fact]:
    return action.add | action.delete


def _needed(action: Action) -> frozenset[Fact]:
    return frozenset(literal.fact for literal in action.pre)
