"""What tasks may ask for; what they ask of planners: facts, and given places of things."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.configuration.task import PlanConfig
from bestman_bt.engine import NodeRegistry
from bestman_bt.facts.evidence import DrawnTask, Evidence, Verdict, joined
from bestman_bt.facts.goals.at_goal import AtGoal
from bestman_bt.facts.goals.goal import Goal, surface_names, unknown
from bestman_bt.facts.goals.lifted import Lifted
from bestman_bt.facts.goals.opened import Opened
from bestman_bt.facts.goals.placed import Placed
from bestman_bt.facts.goals.tidied import Tidied
from bestman_bt.facts.goals.tool_at import ToolAt
from bestman_bt.facts.predicate import Beliefs
from bestman_bt.registry import BUILDERS, PLANNERS, suggestion
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.state import PredicateError, asked, known_predicates
from bestman_bt.task_planning.symbolic import GoalError, Literal


class Facts(Goal[PlanConfig]):
    """Each fact that can be judged, by the true state; of the others the robot's own word counts."""

    fields = ("plan",)
    measures: ClassVar[Mapping[str, tuple[str, ...]]] = {"facts": ("facts_judged", "facts_share")}

    def __init__(self, task: DrawnTask, registry: NodeRegistry) -> None:
        super().__init__(task)
        self._registry = registry

    @cached_property
    def literals(self) -> tuple[Literal, ...]:
        """The facts, with the full names of things; GoalError for bad ones."""
        known = Beliefs(self.world_model.as_at_the_start())
        return Domain.of(self._registry).problem(known, self.asked.goal).goal

    def problems(self) -> Iterator[Problem]:
        """Invalid goals, goals that cannot be judged, and unknown names."""
        asked, config = self.asked, self.config
        try:
            literals = self.literals
        except GoalError as error:
            yield config.problem(("plan", "goal"), str(error))
        else:
            judged = "facts" in config.task.predicates
            for literal in literals if judged and not any(map(can_be_judged, literals)) else ():
                known = [name for name, one in known_predicates().items() if one.why_not is not None]
                message = f"{literal} cannot be judged; {suggestion(literal.fact.predicate, known)}"
                yield config.problem(("plan", "goal"), message)
        for field, registered in (("planner", PLANNERS), ("builder", BUILDERS)):
            names = registered.names()
            yield from unknown(config, ("plan", field), getattr(asked, field), names, f"unknown {field}")
        try:
            PlanLimits.from_string(asked.limits)
        except ValueError as error:
            yield config.problem(("plan", "limits"), str(error))
        for name, place in asked.told.items():
            path = ("plan", "told", name)
            yield from unknown(config, path, name, self.world_model.models, "the robot knows no object")
            yield from unknown(config, path, place, surface_names(self.world_model), "the map has no surface")

    def entries(self) -> dict[str, Any]:
        """``goal``, ``planner``, ``builder``, ``limits``, ``replans``."""
        return {name: getattr(self.asked, name) for name in ("goal", "planner", "builder", "limits", "replans")}

    def told(self) -> dict[str, str]:
        """As the task says."""
        found = {}
        for name, place in self.asked.told.items():
            furniture, surface = self.world_model.map.surface(place)
            found[name] = f"{furniture.name}/{surface.name}"
        return found

    def subjects(self) -> list[str]:
        """The first thing of each fact."""
        return [name for literal in self.literals for name in literal.fact.arguments[:1]]

    def judged(self, predicate: str, evidence: Evidence) -> Verdict:
        """Metrics: ``facts_judged``, how many can be judged; ``facts_share``, how many of them hold."""
        verdicts = [_judged(evidence, literal) for literal in self.literals if can_be_judged(literal)]
        both = joined(verdicts)
        share = sum(verdict.holds for verdict in verdicts) / len(verdicts)
        return Verdict(both.holds, both.why, {"facts_judged": len(verdicts), "facts_share": share})


KINDS: tuple[type[Goal[Any]], ...] = (Placed, Opened, Tidied, ToolAt, AtGoal, Lifted, Facts)
"""What a task may ask for; of two that fill an entry of the same name, the later one does."""


def goals_of(task: DrawnTask, registry: NodeRegistry | None) -> tuple[Goal[Any], ...]:
    """What a task asks for in a drawn world; without a registry no facts."""
    goals: list[Goal[Any]] = [kind(task) for kind in KINDS if kind is not Facts and kind.is_asked(task.config)]
    if registry is not None and Facts.is_asked(task.config):
        goals.append(Facts(task, registry))
    return tuple(goals)


def kind_judged_by(predicate: str) -> type[Goal[Any]] | None:
    """What a predicate judges; None for an unknown one."""
    return next((kind for kind in KINDS if predicate in kind.measures), None)


def metric_names(config: RunConfig) -> list[str]:
    """What the judge of a task may measure."""
    judged = [(kind_judged_by(predicate), predicate) for predicate in config.task.predicates]
    return [name for kind, predicate in judged if kind is not None for name in kind.metric_names(config, predicate)]


def can_be_judged(literal: Literal) -> bool:
    """Whether it is about the world; of the robot's beliefs alone nothing is true or false."""
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
