"""A goal in a state, and who is to reach it: what ``bestman-bt plan`` asks of planners, builders and verification."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from bestman_bt.configuration import ConfigurationError
from bestman_bt.configuration import Problem as WrongInput
from bestman_bt.engine import Problem as Fault
from bestman_bt.task_planning.builders import PlanTree, TreeBuilder
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.planners import made_planner
from bestman_bt.task_planning.predicates import UNSEEN, Beliefs
from bestman_bt.task_planning.symbolic import Problem, TaskPlan
from bestman_bt.task_planning.verification import verify
from bestman_bt.world_model import WorldModel

if TYPE_CHECKING:
    from bestman_bt.runtime import Setup


@dataclass(frozen=True)
class Transcript:
    """Where what is said to and by a language model is written, or taken from."""

    record: Path | None = None
    replay: Path | None = None


class PlanQuestion:
    """``beliefs``: what is known when it is planned."""

    def __init__(self, setup: Setup, beliefs: WorldModel, builder: TreeBuilder, limits: PlanLimits) -> None:
        self.setup = setup
        self.beliefs = beliefs
        self.builder = builder
        self.limits = limits
        self.domain = Domain.of(setup.registry)

    def answer(
        self, text: str | None, goal: str | None, planner: str, transcript: Transcript
    ) -> tuple[Problem, TaskPlan]:
        """The problem as it is understood, and a plan. Raises PlanningError."""
        problem = self.domain.problem(Beliefs(self.beliefs), goal)
        if text is None and planner != "language":
            return problem, plan_within(made_planner(planner), problem, self.limits)
        from bestman_bt.task_planning import language

        parameters = language.LanguagePlannerParameters(limits=self.limits)
        record, replay = transcript.record, transcript.replay
        try:
            found = language.plan_from_text(
                text or "", problem, planner, parameters, record=record, replay=replay, further=self._refusals
            )
        except (language.EndpointNotSetError, language.TranscriptError) as error:
            raise ConfigurationError([WrongInput("bestman-bt plan", None, "", str(error))]) from error
        return found.problem, found.plan

    def told(self, problem: Problem) -> dict[str, str]:
        """Object → the one place where it can be, of what was not seen."""
        places: dict[str, list[str]] = {}
        for fact in problem.state:
            if fact.predicate == UNSEEN.name:
                places.setdefault(fact.arguments[0], []).append(fact.arguments[1])
        return {name: found[0] for name, found in sorted(places.items()) if len(found) == 1}

    def tree(self, problem: Problem, plan: TaskPlan) -> PlanTree:
        """The tree of a plan."""
        leaves = [ability.name for ability in self.domain.abilities if not ability.is_subtree]
        return self.builder.build(plan, problem.goal, leaves)

    def faults(self, problem: Problem, made: PlanTree) -> list[Fault]:
        """What verification says."""
        return verify(made.document().to_xml(), problem, self.setup.registry, self.setup.robot_model, self.beliefs)

    def _refusals(self, problem: Problem, plan: TaskPlan) -> list[str]:
        faults = self.faults(problem, self.tree(problem, plan))
        return [str(fault) for fault in faults if fault.severity != "warning"]
