"""What the user allows a planner to do, whatever it is asked or told."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from bestman_bt.registry import suggestion
from bestman_bt.task_planning.symbolic import Action, Fact, GoalError, Literal, Operator, Problem

_ALLOWED = "allowed"


@dataclass(frozen=True)
class PlanLimits:
    """``max_actions``, ``max_cost``: of a whole plan. ``abilities``: the only ones that may be used (None: all).
    ``forbidden``: objects, places and containers that no action may name.
    """

    max_actions: int = 30
    max_cost: float = math.inf
    abilities: frozenset[str] | None = None
    forbidden: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        if self.max_actions < 1:
            raise ValueError(f"max_actions is {self.max_actions}; 1 or more are accepted")
        if not self.max_cost > 0.0:
            raise ValueError(f"max_cost is {self.max_cost}; more than 0 is accepted")

    def check_names(self, problem: Problem) -> None:
        """GoalError, with the closest name, where a limit names what there is not: it would limit nothing."""
        known = {operator.name: "" for operator in problem.operators}
        for what, names, there in (
            ("ability", self.abilities or (), known),
            ("thing", self.forbidden, dict(problem.objects)),
        ):
            for name in sorted(names):
                if name not in there:
                    raise GoalError(f"the limits name an unknown {what} {name!r}; {suggestion(name, list(there))}")

    def renamed(self, names: Mapping[str, str]) -> PlanLimits:
        """The same for a world where things have other ``names``."""
        return replace(self, forbidden=frozenset(names[name] for name in self.forbidden))

    def operators(self, problem: Problem) -> tuple[Operator, ...]:
        """The abilities that may be used."""
        allowed = self.abilities
        return tuple(operator for operator in problem.operators if allowed is None or operator.name in allowed)

    def things(self, problem: Problem, kind: str) -> list[str]:
        """The things of a type that may be named."""
        return [name for name in problem.of_type(kind) if name not in self.forbidden]

    def applied_to(self, problem: Problem) -> Problem:
        """The problem in which no planner can break ``abilities`` and ``forbidden``: a thing is for use only where the
        static fact ``allowed(thing)`` holds.
        """
        operators = self.operators(problem)
        if not self.forbidden:
            return replace(problem, operators=operators)
        allowed = frozenset(Fact(_ALLOWED, (name,)) for name in problem.objects if name not in self.forbidden)
        return replace(problem, operators=tuple(map(_guarded, operators)), state=problem.state | allowed)

    def faults(self, actions: Collection[Action]) -> list[str]:
        """Where a plan goes beyond the limits."""
        faults = []
        if len(actions) > self.max_actions:
            faults.append(f"{len(actions)} steps; at most {self.max_actions} are allowed")
        cost = math.fsum(action.cost for action in actions)
        if cost > self.max_cost:
            faults.append(f"the steps cost {cost:g}; at most {self.max_cost:g} is allowed")
        for number, action in enumerate(actions, start=1):
            if self.abilities is not None and action.name not in self.abilities:
                faults.append(f"step {number}: {action.name} is not allowed")
            faults += [f"step {number}: {name} may not be named" for name in self._forbidden_in(action.arguments)]
        return faults

    def _forbidden_in(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name in self.forbidden]


def _guarded(operator: Operator) -> Operator:
    allowed = tuple(Literal(Fact(_ALLOWED, (f"{{{parameter}}}",))) for parameter in operator.parameters)
    return replace(operator, pre=(*operator.pre, *allowed))
