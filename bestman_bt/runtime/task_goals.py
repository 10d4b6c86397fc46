"""The goal ``facts`` for planners: facts to achieve, and given places of objects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, ClassVar

from pydantic import Field
from typing_extensions import override

from bestman_bt.configuration.errors import Problem, up_to_unread_field
from bestman_bt.facts.evidence import Evidence, Verdict, joined
from bestman_bt.facts.goals.goal import Goal, surface_names, unknown
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.registry import BUILDERS, PLANNERS, suggestion
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.state import PredicateError, asked, known_predicates
from bestman_bt.task_planning.symbolic.problem import GoalError, Literal


@dataclass(frozen=True)
class FactsFields:
    """The facts of ``goal``, such as ``on(cup, table) and closed(drawer_3)``, are the goal.

    ``given_places``: object → its surface. ``planner``, ``builder``, ``limits``: as for the tree ``ReachGoal``.
    ``replans``: largest number of replans.
    """

    goal: str
    given_places: Mapping[str, str] = field(default_factory=dict, metadata={"was": "told"})
    planner: str = "symbolic"
    builder: str = "reactive"
    limits: str = ""
    replans: Annotated[int, Field(ge=0, le=1000)] = 20


class Facts(Goal[FactsFields]):
    """Judges facts by the ground truth where possible; for the others the robot's belief counts."""

    parameters = FactsFields
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"facts": ("facts_judged", "facts_share")}
    fills = ("goal", "planner", "builder", "limits", "replans")
    needs_nodes = True

    @cached_property
    def literals(self) -> tuple[Literal, ...]:
        """The facts, with the full names of things. Raises GoalError for invalid facts."""
        known = Beliefs(self.world_model.initial_beliefs())
        return Domain.of(self.task.registry).problem(known, self.asked.goal).goal_literals

    def problems(self) -> Iterator[Problem]:
        """Yield invalid goals, goals that cannot be judged, and unknown names."""
        yield from self._goal_faults()
        asked, config = self.asked, self.config
        for name, registered in (("planner", PLANNERS), ("builder", BUILDERS)):
            names = registered.names()
            yield from unknown(config, (*self.path, name), getattr(asked, name), names, f"unknown {name}")
        try:
            PlanLimits.from_string(asked.limits)
        except ValueError as error:
            yield self.fault(str(error), "limits")
        for name, place in asked.given_places.items():
            path = (*self.path, "given_places", name)
            yield from unknown(config, path, name, self.world_model.models, "the robot does not know an object")
            yield from unknown(config, path, place, surface_names(self.world_model), "the map has no surface")

    @up_to_unread_field
    def _goal_faults(self) -> Iterator[Problem]:
        try:
            literals = self.literals
        except GoalError as error:
            yield self.fault(str(error), "goal")
        else:
            judged = "facts" in self.config.task.predicates
            for literal in literals if judged and not any(map(can_be_judged, literals)) else ():
                known = [name for name, one in known_predicates().items() if one.why_not is not None]
                message = f"{literal} cannot be judged; {suggestion(literal.fact.predicate, known)}"
                yield self.fault(message, "goal")

    def entries(self) -> dict[str, Any]:
        """Return the entries ``goal``, ``planner``, ``builder``, ``limits``, ``replans``."""
        return {name: getattr(self.asked, name) for name in ("goal", "planner", "builder", "limits", "replans")}

    @override
    def given_places(self) -> dict[str, str]:
        found = {}
        for name, place in self.asked.given_places.items():
            furniture, surface = self.world_model.map.surface(place)
            found[name] = f"{furniture.name}/{surface.name}"
        return found

    def subjects(self) -> list[str]:
        """Return the first argument of each fact."""
        return [name for literal in self.literals for name in literal.fact.arguments[:1]]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Return the verdict with the metrics ``facts_judged``, the number of judgeable facts, and ``facts_share``, the
        fraction that holds.
        """
        verdicts = [_judged(evidence, literal) for literal in self.literals if can_be_judged(literal)]
        both = joined(verdicts)
        share = sum(verdict.holds for verdict in verdicts) / len(verdicts)
        return Verdict(both.holds, both.why, {"facts_judged": len(verdicts), "facts_share": share})


def can_be_judged(literal: Literal) -> bool:
    """Return whether a fact is about the world, not only about the robot's beliefs."""
    predicate = known_predicates().get(literal.fact.predicate)
    return predicate is not None and (predicate.why_still if literal.negated else predicate.why_not) is not None


def _judged(evidence: Evidence, literal: Literal) -> Verdict:
    predicate = known_predicates()[literal.fact.predicate]
    function = predicate.why_still if literal.negated else predicate.why_not
    assert function is not None
    try:
        fault = asked(predicate, function, evidence, literal.fact.arguments)
    except PredicateError as error:
        fault = str(error)
    return Verdict(not fault, fault)
