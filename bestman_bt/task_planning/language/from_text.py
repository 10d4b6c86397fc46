"""From an instruction in words to a checked plan, with any planner."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path

from bestman_bt.task_planning.base import TaskPlanner
from bestman_bt.task_planning.language.answers import checked_goal, checked_plan
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatRequest, Usage
from bestman_bt.task_planning.language.conversation import FaultyAnswerError, ask_until_valid
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.prompt import PlainNames, goal_messages, plan_messages
from bestman_bt.task_planning.language.schema import GoalAnswer, PlanAnswer, json_schema, plan_answer
from bestman_bt.task_planning.language.transcripts import RecordingEndpoint, ReplayEndpoint, open_transcript
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.planners import made_planner, planner_class
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import PlanningError, PlanningProblem, TaskPlan

# A language model as task planner: it proposes, what it proposes is checked, and nothing unchecked comes out.


PlanCheck = Callable[[PlanningProblem, TaskPlan], Sequence[str]]
"""What else is wrong with a plan for a problem, in words; nothing where it may be carried out."""


@dataclass(frozen=True)
class Proposal:
    """The result: the problem with the goal as understood, a checked plan for it, and its cost."""

    problem: PlanningProblem
    plan: TaskPlan
    usage: Usage


@dataclass(frozen=True)
class LanguagePlanner(TaskPlanner):
    """Asks for the steps (as SayCan and ProgPrompt do), checks each answer and reports its faults to the model.

    ``endpoint``: None: that of the environment, read when a plan is requested. ``further``: an additional check of a
    plan, for example of its tree on this robot; its faults are also reported to the model.

    ``tries``: largest number of questions. ``limits``: set by the user.
    """

    tries: int = 4
    limits: PlanLimits = field(default_factory=PlanLimits)
    endpoint: ChatEndpoint | None = None
    further: PlanCheck | None = None

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        """Return a plan for the goal, or for the instruction if there is no goal; raises also LanguageError."""
        return self.propose(problem).plan

    def propose(self, problem: PlanningProblem) -> Proposal:
        """Return the plan with the goal that it reaches.

        Raises:
            LanguageError: there is no valid answer.
            GoalError: the limits contain unknown names.
        """
        further = self.further
        names = PlainNames.of(problem.objects)
        told, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.told)
        model = plan_answer(told, limits)

        def check(answer: PlanAnswer) -> tuple[PlanningProblem, TaskPlan]:
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


# Only the goal comes from a language model; a planner finds the way (LLM+P: Liu et al., 2023).


@dataclass(frozen=True)
class GoalReader:
    """Converts an instruction to the facts of a goal.

    ``tries``: largest number of questions. ``limits``: set by the user. ``endpoint``: None: that of the environment.
    """

    tries: int = 4
    limits: PlanLimits = field(default_factory=PlanLimits)
    endpoint: ChatEndpoint | None = None

    def read(self, problem: PlanningProblem) -> tuple[PlanningProblem, Usage]:
        """Return the problem with the goal of its instruction.

        Raises:
            LanguageError: there is no valid answer.
            GoalError: the limits contain unknown names.
        """
        names = PlainNames.of(problem.objects)
        told, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.told)
        request = ChatRequest(goal_messages(told, limits), json_schema(GoalAnswer))
        endpoint = self.endpoint or HttpEndpoint(EndpointAddress.from_environment())
        meant, usage = ask_until_valid(
            endpoint, request, GoalAnswer, lambda answer: checked_goal(told, answer), self.tries
        )
        return names.meant(problem, meant), usage


def plan_from_text(
    text: str,
    problem: PlanningProblem,
    planner: str = "language",
    *,
    tries: int = 4,
    limits: PlanLimits | None = None,
    record: Path | None = None,
    replay: Path | None = None,
    further: PlanCheck | None = None,
) -> Proposal:
    """Return a plan for the instruction ``text`` in the state of ``problem``; empty: for the problem's own goal.

    ``planner``: ``language`` asks the model for the steps; any other registered planner plans for the goal that the
    model reads from the text. ``tries``, ``limits``, ``further``: see LanguagePlanner. ``record``, ``replay``: a
    transcript to write, or to read the answers from. Raises LanguageError, UnknownNameError, or the planner's errors.
    """
    made = planner_class(planner)
    if text:
        problem = replace(problem, instruction=text, goal=())
    limits = limits or PlanLimits()
    with ExitStack() as files:
        endpoint: ChatEndpoint
        if replay is not None:
            endpoint = ReplayEndpoint(replay)
        else:
            endpoint = HttpEndpoint(EndpointAddress.from_environment())
        if record is not None:
            endpoint = RecordingEndpoint(endpoint, files.enter_context(open_transcript(record)))
        if issubclass(made, LanguagePlanner):
            return made(tries=tries, limits=limits, endpoint=endpoint, further=further).propose(problem)
        meant, usage = GoalReader(tries, limits, endpoint).read(problem)
    plan = plan_within(made_planner(planner), meant, limits)
    faults = further(meant, plan) if further is not None else ()
    if faults:
        raise PlanningError("; ".join(faults))
    return Proposal(meant, plan, usage)
