"""From an instruction as text to a checked plan, with any planner."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from bestman_bt.errors import Error
from bestman_bt.facts.located import UNSEEN
from bestman_bt.facts.on import ON
from bestman_bt.task_planning.base import TaskPlanner, made_planner, planner_class
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.language.chat import (
    ChatEndpoint,
    ChatReply,
    ChatRequest,
    Message,
    RecordingEndpoint,
    ReplayEndpoint,
    Usage,
    open_transcript,
)
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.errors import ModelRefusedError, NoValidAnswerError, quoted
from bestman_bt.task_planning.language.prompt import PlainNames, fault_message, goal_messages, plan_messages
from bestman_bt.task_planning.language.schema import GoalAnswer, PlanAnswer, faults_of, json_schema, plan_answer
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.symbolic.grounding import ground, instantiate
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    Fact,
    GoalError,
    Literal,
    PlanningError,
    PlanningProblem,
    TaskPlan,
)
from bestman_bt.task_planning.symbolic.search import without_unneeded_actions

PlanCheck = Callable[[PlanningProblem, TaskPlan], Sequence[str]]
"""Returns the reasons why a plan for a problem must not be executed; empty if it may be."""


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
        """Return a plan for the goal, or for the instruction if there is no goal. Raises the errors of
        ``TaskPlanner.plan``, and LanguageError.
        """
        return self.propose(problem).plan

    def propose(self, problem: PlanningProblem) -> Proposal:
        """Return the plan with the goal that it reaches.

        Raises:
            LanguageError: there is no valid answer.
            GoalError: the limits contain unknown names.
        """
        further = self.further
        names = PlainNames.of(problem.objects)
        renamed, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.in_prompt)
        model = plan_answer(renamed, limits)

        def check(answer: PlanAnswer) -> tuple[PlanningProblem, TaskPlan]:
            solved, plan = checked_plan(renamed, limits, answer)
            meant = names.meant(problem, solved)
            operators = {operator.name: operator for operator in problem.operators}
            actions = (instantiate(meant, operators[one.name], names.back(one.arguments)) for one in plan.actions)
            plan = TaskPlan(tuple(actions))
            faults = further(meant, plan) if further is not None else ()
            if faults:
                raise FaultyAnswerError(faults)
            return meant, plan

        request = ChatRequest(plan_messages(renamed, limits), json_schema(model))
        endpoint = self.endpoint or HttpEndpoint(EndpointAddress.from_environment())
        (meant, plan), usage = ask_until_valid(endpoint, request, model, check, self.tries)
        return Proposal(meant, plan, usage)


@dataclass(frozen=True)
class GoalReader:
    """Converts an instruction to the facts of a goal, for a symbolic planner to solve.

    B. Liu et al., "LLM+P: empowering large language models with optimal planning proficiency", 2023.

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
        renamed, limits = names.renamed(problem), self.limits.resolved(problem).renamed(names.in_prompt)
        request = ChatRequest(goal_messages(renamed, limits), json_schema(GoalAnswer))
        endpoint = self.endpoint or HttpEndpoint(EndpointAddress.from_environment())
        meant, usage = ask_until_valid(
            endpoint, request, GoalAnswer, lambda answer: checked_goal(renamed, answer), self.tries
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


def checked_goal(problem: PlanningProblem, answer: GoalAnswer) -> PlanningProblem:
    """Return the problem with the goal of the answer, unless it already has one. Given places restrict where unseen
    objects may be.

    Raises FaultyAnswerError listing every fault.
    """
    if problem.goal:
        return problem
    goal, faults = _facts(problem, "goal", answer.goal)
    given, faults_of_given = _facts(problem, "given_places", answer.given_places)
    faults += faults_of_given
    no_place = [literal for literal in given if literal.negated or literal.fact.predicate != ON.name]
    faults += [f"given_places: {literal} does not state where an object is" for literal in no_place]
    if not goal and not faults:
        faults.append("goal: empty; state the facts that must hold at the end, or give a refusal")
    try:
        Domain(()).refuse_contradictions(goal)
    except GoalError as error:
        faults.append(f"goal: {error}")
    if faults:
        raise FaultyAnswerError(faults)
    state = problem.state - _ruled_out(problem, [literal.fact for literal in given])
    return replace(problem, goal=tuple(dict.fromkeys(goal)), state=state)


def _facts(problem: PlanningProblem, field: str, texts: Sequence[str]) -> tuple[list[Literal], list[str]]:
    """Return the facts in the texts with full names, and the faults."""
    domain = Domain(())
    literals: list[Literal] = []
    faults: list[str] = []
    for number, text in enumerate(texts):
        try:
            literals += domain.with_goal(problem, text).goal_literals
        except GoalError as error:
            faults.append(f"{field}[{number}]: {error}")
    return literals, faults


def _ruled_out(problem: PlanningProblem, given: Sequence[Fact]) -> set[Fact]:
    """Return the facts excluded by given places of unseen things; places that were searched do not count."""
    places: dict[str, set[str]] = {}
    for fact in given:
        name, place = fact.arguments
        if Fact(UNSEEN.name, (name, place)) in problem.state:
            places.setdefault(name, set()).add(place)
    return {
        fact
        for fact in problem.state
        if fact.predicate == UNSEEN.name and fact.arguments[1] not in places.get(fact.arguments[0], fact.arguments)
    }


def checked_plan(problem: PlanningProblem, limits: PlanLimits, answer: PlanAnswer) -> tuple[PlanningProblem, TaskPlan]:
    """Return the problem with its goal, and the plan without unnecessary steps. Raises FaultyAnswerError listing every
    fault."""
    problem = checked_goal(problem, answer)
    operators = {operator.name: operator for operator in limits.operators(problem)}
    try:
        actions = [instantiate(problem, operators[step.ability], step.values) for step in answer.plan]
        faults = limits.faults(actions) or _run_through(problem, actions)
        if not faults:
            return problem, TaskPlan(_needed(problem, actions))
    except PlanningError as error:
        faults = [str(error)]
    raise FaultyAnswerError(faults)


def _run_through(problem: PlanningProblem, actions: Sequence[Action]) -> list[str]:
    """Simulate the steps up to the first that is not applicable or leads back to an earlier state."""
    state = problem.state
    been = {state: "the start"}
    for number, action in enumerate(actions, start=1):
        broken = action.broken_in(state)
        if broken:
            return [f"step {number}, {action}: it needs {' and '.join(map(str, broken))}, which does not hold then"]
        state = action.applied_to(state)
        if state in been:
            return [f"step {number}, {action}: all is then as after {been[state]}; leave out what goes in a circle"]
        been[state] = f"step {number}, {action}"
    unmet = problem.unmet_in(state)
    after = "the plan is empty, and" if not actions else "after the last step"
    return [f"{after} the goal's {' and '.join(map(str, unmet))} does not hold"] if unmet else []


def _needed(problem: PlanningProblem, actions: Sequence[Action]) -> tuple[Action, ...]:
    """Return the steps without those that the goal does not need."""
    grounded = ground(problem)
    numbers = {action: number for number, action in enumerate(grounded.actions)}
    kept = without_unneeded_actions(grounded, [numbers[action] for action in actions])
    return tuple(grounded.actions[number] for number in kept)


Answer = TypeVar("Answer", bound=GoalAnswer)
Checked = TypeVar("Checked")

_LONGEST_ANSWER = 2000
_LOG = logging.getLogger(__name__)


class FaultyAnswerError(Error):
    """An answer is invalid; ``faults``: messages from which the model can correct it."""

    def __init__(self, faults: Sequence[str]) -> None:
        super().__init__("; ".join(map(quoted, faults)))
        self.faults = tuple(quoted(fault) for fault in faults)


def ask_until_valid(
    endpoint: ChatEndpoint,
    request: ChatRequest,
    model: type[Answer],
    check: Callable[[Answer], Checked],
    tries: int,
) -> tuple[Checked, Usage]:
    """Return the first answer that follows ``model``, as converted by ``check``, which raises FaultyAnswerError.

    Raises RefusedError, NoValidAnswerError, and the endpoint's errors.
    """
    used: Usage | None = None
    faults: tuple[str, ...] = ()
    answer = ""
    for number in range(1, tries + 1):
        reply = endpoint.complete(request)
        used = reply.usage if used is None else used + reply.usage
        try:
            checked = check(_parsed(reply, model))
        except FaultyAnswerError as error:
            faults = error.faults
            answer = quoted(_repeated(reply))
            _LOG.warning("answer %d of at most %d was not accepted: %s; it was: %s", number, tries, error, answer)
            request = request.followed_by(Message("assistant", _repeated(reply)), fault_message(faults))
        else:
            _LOG.info("answer %d was accepted: %s in all", number, used)
            return checked, used
    raise NoValidAnswerError(tries, faults, answer)


def _parsed(reply: ChatReply, model: type[Answer]) -> Answer:
    if reply.refusal:
        raise ModelRefusedError(quoted(reply.refusal))
    if not reply.complete:
        raise FaultyAnswerError(["the answer was cut off at the limit of its length; give a shorter one"])
    if reply.tools and not reply.text:
        raise FaultyAnswerError([f"you called {', '.join(reply.tools[:3])}; there are no tools, answer in the message"])
    try:
        answer = model.model_validate_json(_without_fence(reply.text))
    except ValidationError as error:
        raise FaultyAnswerError(faults_of(error)) from None
    if answer.refusal and answer.refusal.strip():
        raise ModelRefusedError(quoted(answer.refusal))
    return answer


def _without_fence(text: str) -> str:
    """Return the content of the single code fence that models without a JSON mode often put around their answer."""
    lines = text.strip().splitlines()
    fenced = len(lines) > 2 and lines[0] in ("```", "```json") and lines[-1] == "```"
    return "\n".join(lines[1:-1]) if fenced else text


def _repeated(reply: ChatReply) -> str:
    """Return the model's answer, shortened for repetition."""
    text = reply.text or "(no text)"
    return text if len(text) <= _LONGEST_ANSWER else text[:_LONGEST_ANSWER] + "…"
