"""From an instruction in words to a checked plan, by any planner."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from bestman_bt.task_planning.language.chat import ChatEndpoint
from bestman_bt.task_planning.language.endpoint import EndpointAddress, HttpEndpoint
from bestman_bt.task_planning.language.goals import GoalReader
from bestman_bt.task_planning.language.planner import (
    LanguagePlanner,
    PlanCheck,
    Proposal,
)
from bestman_bt.task_planning.language.transcripts import RecordingEndpoint, ReplayEndpoint, open_transcript
from bestman_bt.task_planning.limits import PlanLimits, plan_within
from bestman_bt.task_planning.planners import made_planner, planner_class
from bestman_bt.task_planning.symbolic import PlanningError, Problem


def plan_from_text(
    text: str,
    problem: Problem,
    planner: str = "language",
    *,
    tries: int = 4,
    limits: PlanLimits | None = None,
    record: Path | None = None,
    replay: Path | None = None,
    further: PlanCheck | None = None,
) -> Proposal:
    """A plan for what ``text`` asks for, in the state of ``problem``; empty: for the problem's own goal.

    ``planner``: ``language`` asks the model for the steps; any other name of the registry plans for the goal that the
    model reads from the text. ``tries``, ``limits``, ``further``: see LanguagePlanner. ``record``, ``replay``: a
    transcript to write, or to take the answers from instead of an endpoint. Raises LanguageError, or what the planner
    raises; UnknownNameError for a planner that there is not.
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
