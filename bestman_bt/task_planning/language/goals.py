"""Only the goal comes from a language model; a planner finds the way (LLM+P: Liu et al., 2023)."""

from __future__ import annotations

from dataclasses import dataclass, field

from bestman_bt.task_planning.language.answers import checked_goal
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatRequest, Usage
from bestman_bt.task_planning.language.conversation import ask_until_valid
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.names import PlainNames
from bestman_bt.task_planning.language.prompt import goal_messages
from bestman_bt.task_planning.language.schema import GoalAnswer, json_schema
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic import Problem


@dataclass(frozen=True)
class GoalReader:
    """From an instruction to the facts that shall hold.

    ``tries``: questions until an answer has no fault. ``limits``: what the user allows. ``endpoint``: None asks that of
    the environment.
    """

    tries: int = 4
    limits: PlanLimits = field(default_factory=PlanLimits)
    endpoint: ChatEndpoint | None = None

    def read(self, problem: Problem) -> tuple[Problem, Usage]:
        """The problem with the goal that its instruction means. Raises LanguageError where no valid answer comes,
        GoalError where the limits name what there is not.
        """
        names = PlainNames.of(problem.objects)
        told, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.told)
        request = ChatRequest(goal_messages(told, limits), json_schema(GoalAnswer))
        endpoint = self.endpoint or HttpEndpoint(EndpointAddress.from_environment())
        meant, usage = ask_until_valid(
            endpoint, request, GoalAnswer, lambda answer: checked_goal(told, answer), self.tries
        )
        return names.meant(problem, meant), usage
