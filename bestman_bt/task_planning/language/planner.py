"""A language model as task planner: it proposes, what it proposes is checked, and nothing unchecked comes out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.language.answers import checked_plan
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatRequest, Usage
from bestman_bt.task_planning.language.conversation import FaultyAnswerError, ask_until_valid
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.names import PlainNames
from bestman_bt.task_planning.language.prompt import plan_messages
from bestman_bt.task_planning.language.schema import PlanAnswer, json_schema, plan_answer
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic import Problem, TaskPlan, instantiate

PlanCheck = Callable[[Problem, TaskPlan], Sequence[str]]
"""What else is wrong with a plan for a problem, in words; nothing where it may be carried out."""


@dataclass(frozen=True)
class Proposal:
    """What came out: the problem with the goal as it was understood, a plan for it that was checked, and its price."""

    problem: Problem
    plan: TaskPlan
    usage: Usage


@dataclass(frozen=True)
class LanguagePlanner(TaskPlanner):
    """Asks for the steps (as SayCan and ProgPrompt do), checks each answer and tells the model what is wrong with it.

    ``endpoint``: None asks that of the environment, once a plan is wanted. ``further``: what else has to be true of a
    plan, for example of its tree on this robot; its words go back to the model as well.

    ``tries``: questions until an answer has no fault. ``limits``: what the user allows.
    """

    tries: int = 4
    limits: PlanLimits = field(default_factory=PlanLimits)
    endpoint: ChatEndpoint | None = None
    further: PlanCheck | None = None

    def plan(self, problem: Problem) -> TaskPlan:
        """As ``TaskPlanner.plan``, for the goal, or for the instruction where there is none; LanguageError beside."""
        return self.propose(problem).plan

    def propose(self, problem: Problem) -> Proposal:
        """The plan with the goal that it reaches. Raises LanguageError where no valid answer comes, GoalError where the
        limits name what there is not.
        """
        further = self.further
        names = PlainNames.of(problem.objects)
        told, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.told)
        model = plan_answer(told, limits)

        def check(answer: PlanAnswer) -> tuple[Problem, TaskPlan]:
            solved, plan = checked_plan(told, limits, answer)
            meant = names.meant(problem, solved)
            operators = {operator.name: operator for operator in problem.operators}
            actions = (instantiate(meant, operators[one.name], names.back(one.arguments)) for one in plan.actions)
            plan = TaskPlan(tuple(actions))
            faults = further(meant, plan) if further is not None else ()
            if faults:
                raise FaultyAnswerError(faults)
            return meant, plan

        request = ChatRequest(plan_messages(told, limits), json_schema(model))
        endpoint = self.endpoint or HttpEndpoint(EndpointAddress.from_environment())
        (meant, plan), usage = ask_until_valid(endpoint, request, model, check, self.tries)
        return Proposal(meant, plan, usage)
