"""Only the goal comes from a language model; a planner finds the way (LLM+P: Liu et al., 2023)."""

from __future__ import annotations

from bestman_bt.task_planning.language.answers import checked_goal
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatRequest, Usage
from bestman_bt.task_planning.language.conversation import ask_until_valid
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.names import PlainNames
from bestman_bt.task_planning.language.planner import LanguagePlannerParameters
from bestman_bt.task_planning.language.prompt import goal_messages
from bestman_bt.task_planning.language.schema import GoalAnswer, json_schema
from bestman_bt.task_planning.symbolic import Problem


class GoalReader:
    """From an instruction to the facts that shall hold; ``endpoint``: None asks that of the environment."""

    def __init__(
        self, parameters: LanguagePlannerParameters | None = None, endpoint: ChatEndpoint | None = None
    ) -> None:
        self.parameters = parameters or LanguagePlannerParameters()
        self._endpoint = endpoint

    def read(self, problem: Problem) -> tuple[Problem, Usage]:
        """The problem with the goal that its instruction means. Raises LanguageError where no valid answer comes,
        GoalError where the limits name what there is not.
        """
        p = self.parameters
        names = PlainNames.of(problem.objects)
        told, limits = names.renamed(problem), p.limits.resolved(problem).renamed(names.told)
        request = ChatRequest(goal_messages(told, limits), json_schema(GoalAnswer))
        endpoint = self._endpoint or HttpEndpoint(EndpointAddress.from_environment())
        meant, usage = ask_until_valid(
            endpoint, request, GoalAnswer, lambda answer: checked_goal(told, answer), p.tries
        )
        return names.meant(problem, meant), usage
