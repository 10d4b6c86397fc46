"""Judging a run by the predicates of its task."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from typing import Any

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig
from bestman_bt.configuration.task import FIELDS_OF_GOALS
from bestman_bt.facts.evidence import Evidence, Truth, Verdict, joined
from bestman_bt.facts.goals.goal import Goal, judged
from bestman_bt.registry import GOALS, suggestion
from bestman_bt.robot_model.model import ArmModel
from bestman_bt.runtime.robot_session import RobotSession
from hal.api import Clock

Judge = Callable[[RobotSession, Truth, Clock | None, float], Verdict]
"""Arguments: session, ground truth, the clock to wait for the world to rest (None: judge immediately), metres
driven.
"""


def find_judge(config: RunConfig, known: Collection[Problem] = ()) -> Judge | None:
    """Return the judge of the task, or None if it names no predicate.

    ``known``: faults of the task found so far; goals that could not be read are not reported as missing. Raises
    ConfigurationError for unknown names and missing fields.
    """
    problems = list(_problems(config, any(one.field.partition("[")[0] in FIELDS_OF_GOALS for one in known)))
    if problems:
        raise ConfigurationError(problems)
    return judge_session if config.task.predicates else None


def judge_session(session: RobotSession, truth: Truth, clock: Clock | None, driven: float) -> Verdict:
    """Evaluate the task's goals on the ground truth, after all objects have had time to come to rest."""
    setup = session.setup
    before = {name: truth.object_pose(name).position for name in setup.subjects if name in truth.object_names}
    if clock is not None:
        clock.sleep(setup.config.task.tolerances.rest_time)
    tool_frame = session.skills.arm_model.tool_frame if setup.robot_model.of(ArmModel) else ""
    evidence = Evidence(setup, truth, before, driven, tool_frame)
    return joined(judged(setup.asked, predicate, evidence) for predicate in setup.config.task.predicates)


def success_predicates() -> dict[str, str]:
    """Return the kind of goal that each known success predicate judges."""
    kinds: dict[str, type[Goal[Any]]] = {name: GOALS.resolve(name) for name in GOALS}
    return {predicate: name for name, kind in kinds.items() for predicate in kind.measures}


def _problems(config: RunConfig, goals_wrong: bool) -> Iterator[Problem]:
    judges, kinds = success_predicates(), set(GOALS)
    goals_wrong = goals_wrong or any(len(goal) != 1 or not kinds >= goal.keys() for goal in config.task.goals)
    for index, predicate in enumerate(config.task.predicates):
        path = ("predicate",) if isinstance(config.task.predicate, str) else ("predicate", index)
        if predicate not in judges:
            yield config.problem(path, f"unknown predicate {predicate!r}; {suggestion(predicate, judges)}")
        elif config.task.asked(judges[predicate]) is None and not goals_wrong:
            yield config.problem(("goals",), f"the predicate {predicate!r} needs an entry {{{judges[predicate]}: …}}")
