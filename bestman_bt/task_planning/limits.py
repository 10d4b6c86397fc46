"""Limits of plans set by the user."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from urllib.parse import quote, unquote

from bestman_bt.registry import suggestion
from bestman_bt.task_planning.base import TaskPlanner, actions_of
from bestman_bt.task_planning.domain import without_number
from bestman_bt.task_planning.explanation import explain
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    GoalError,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    TaskPlan,
    Unsolvable,
)

ALLOWED = "allowed"
"""The predicate of things that may be used, in problems with limits."""

_FORBIDDEN = re.compile(rf"{ALLOWED}\(([^)]*)\) is not believed, and no action achieves it")
_ALLOWED = re.compile(rf"{ALLOWED}\(([^)]*)\)")
_NUMBER = re.compile(r"[+-]?\d+(\.\d+)?(e[+-]?\d+)?", re.ASCII)
_FORM = "steps=20; cost=40; only=PickUp, PutAt; without=knife, fridge/door"


class LimitsExceededError(PlanningError):
    """Raised if the plan exceeds the user's limits."""


@dataclass(frozen=True)
class PlanLimits:
    """Limits of plans. ``max_actions``, ``max_cost``: of a whole plan. ``abilities``: the only allowed ones (None:
    all).

    ``forbidden``: objects, places and containers that no action may use.
    """

    max_actions: int = 100
    max_cost: float = math.inf
    abilities: frozenset[str] | None = None
    forbidden: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.max_actions < 1:
            raise ValueError(f"at most {self.max_actions} steps is not a valid limit; it should be 1 or more")
        if self.abilities is not None and not self.abilities:
            raise ValueError("no ability is allowed; name at least one, or omit this limit")
        if not self.max_cost > 0.0:
            raise ValueError(f"a cost of at most {self.max_cost:g} is not a valid limit; it should be more than 0")

    @classmethod
    def from_string(cls, text: str) -> PlanLimits:
        """Parse ``steps=20; cost=40; only=PickUp, PutAt; without=knife, fridge/door``, each part optional.

        Repeated name lists are merged. Separators within names are percent-encoded (``%2C``). Raises ValueError.
        """
        limits, given = cls(), set[str]()
        for part in filter(None, (part.strip() for part in text.split(";"))):
            key, _, value = (piece.strip() for piece in part.partition("="))
            names = frozenset(unquote(name.strip()) for name in value.split(",") if name.strip())
            match key:
                case "steps" | "cost" if key in given:
                    raise ValueError(f"{key} is given twice, the second time by {part!r}")
                case "steps" if value.isascii() and value.isdigit():
                    limits = replace(limits, max_actions=int(value))
                case "cost" if _NUMBER.fullmatch(value):
                    limits = replace(limits, max_cost=float(value))
                case "only" if names:
                    limits = replace(limits, abilities=names | (limits.abilities or frozenset()))
                case "without" if names:
                    limits = replace(limits, forbidden=names | limits.forbidden)
                case "steps" | "cost":
                    raise ValueError(f"{part!r}: {key} takes a number; the form is {_FORM}")
                case _:
                    raise ValueError(f"{part!r} is not a limit; the form is {_FORM}")
            given.add(key)
        return limits

    def to_string(self) -> str:
        """Return the text that ``from_string`` parses; empty for the default limits."""
        default, parts = PlanLimits(), []
        if self.max_actions != default.max_actions:
            parts.append(f"steps={self.max_actions}")
        if self.max_cost != default.max_cost:
            parts.append(f"cost={self.max_cost!r}")
        for key, names in (("only", self.abilities), ("without", self.forbidden)):
            if names:
                parts.append(f"{key}={', '.join(quote(name) for name in sorted(names))}")
        return "; ".join(parts)

    def resolved(self, problem: PlanningProblem) -> PlanLimits:
        """Return the limits with full names: ``fridge`` stands for all parts of the fridge, ``drawer`` for all numbered
        drawers.

        Raises GoalError, with the closest name, for an unknown name.
        """
        known = {operator.name for operator in problem.operators}
        for name in sorted((self.abilities or frozenset()) - known):
            raise GoalError(f"the limits name an unknown ability {name!r}; {suggestion(name, sorted(known))}")
        return replace(
            self, forbidden=frozenset(full for name in sorted(self.forbidden) for full in _meant(name, problem))
        )

    def renamed(self, names: Mapping[str, str]) -> PlanLimits:
        """Return the limits for a world in which objects and places have other ``names``: old → new."""
        return replace(self, forbidden=frozenset(names[name] for name in self.forbidden))

    def operators(self, problem: PlanningProblem) -> tuple[Operator, ...]:
        """Return the allowed abilities."""
        allowed = self.abilities
        return tuple(operator for operator in problem.operators if allowed is None or operator.name in allowed)

    def things(self, problem: PlanningProblem, kind: str) -> list[str]:
        """Return the allowed objects, places or containers of type ``kind``."""
        return [name for name in problem.of_type(kind) if name not in self.forbidden]

    def applied_to(self, problem: PlanningProblem) -> PlanningProblem:
        """Return a problem that enforces ``abilities`` and ``forbidden`` for any planner, by a static fact
        ``allowed(thing)``.

        Raises GoalError for an unknown name.
        """
        forbidden = self.resolved(problem).forbidden
        operators = self.operators(problem)
        if not forbidden:
            return replace(problem, operators=operators)
        allowed = frozenset(Fact(ALLOWED, (name,)) for name in problem.objects if name not in forbidden)
        return replace(problem, operators=tuple(map(_guarded, operators)), state=problem.state | allowed)

    def faults(self, actions: Collection[Action]) -> list[str]:
        """Return the ways in which a plan exceeds the limits, as text."""
        faults = []
        if len(actions) > self.max_actions:
            faults.append(f"{len(actions)} steps; at most {self.max_actions} are allowed")
        cost = math.fsum(action.cost for action in actions)
        if cost > self.max_cost:
            faults.append(f"the steps cost {cost:g}; at most {self.max_cost:g} is allowed")
        for number, action in enumerate(actions, start=1):
            if self.abilities is not None and action.name not in self.abilities:
                faults.append(f"step {number}: {action.name} is not allowed")
            forbidden = [name for name in action.arguments if name in self.forbidden]
            faults += [f"step {number}: {name} may not be named" for name in forbidden]
        return faults


def plan_within(planner: TaskPlanner, problem: PlanningProblem, limits: PlanLimits) -> TaskPlan:
    """Return the plan of any planner for a problem, within limits.

    Raises:
        Unsolvable: with an explanation.
        GoalError: the limits contain an unknown name.
        LimitsExceededError: the plan is too long or too expensive.
        PlanningError: the planner fails or does not return a plan.
    """
    limits = limits.resolved(problem)
    limited = limits.applied_to(problem)
    try:
        found = actions_of(planner, limited)
    except Unsolvable as error:
        why, bounds = _explained(limited) or str(error), limits.to_string()
        raise Unsolvable(f"{why}, within the limits {bounds}" if bounds else why, error.missing) from error
    operators = {operator.name: operator for operator in problem.operators}
    unknown = [action.name for action in found if action.name not in operators]
    if unknown:
        raise PlanningError(f"{type(planner).__name__} plans with {unknown[0]!r}, which is not an ability")
    actions = tuple(instantiate(problem, operators[action.name], action.arguments) for action in found)
    faults = limits.faults(actions)
    if faults:
        raise LimitsExceededError("; ".join(faults))
    return TaskPlan(actions)


def _explained(problem: PlanningProblem) -> str:
    """Return why there is no plan; things that are not ``allowed`` are reported as forbidden by the limits."""
    return _ALLOWED.sub(r"the \1", _FORBIDDEN.sub(r"the limits forbid the \1", explain(problem)))


def _meant(name: str, problem: PlanningProblem) -> list[str]:
    there = list(problem.objects)
    meant = [full for full in there if full == name or full.startswith(f"{name}/") or full.endswith(f"/{name}")]
    meant = meant or [full for full in there if without_number(full) == name]
    if not meant:
        raise GoalError(f"the limits name an unknown thing {name!r}; {suggestion(name, there)}")
    return meant


def _guarded(operator: Operator) -> Operator:
    allowed = tuple(Literal(Fact(ALLOWED, (f"{{{parameter}}}",))) for parameter in operator.parameters)
    return replace(operator, pre=(*operator.pre, *allowed))
