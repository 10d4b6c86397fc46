"""How the predicates of a task judge a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from bestman_bt.configuration import ConfigurationError, Problem, RunConfig
from bestman_bt.facts.evidence import Evidence, Truth, Verdict, joined
from bestman_bt.registry import suggestion
from bestman_bt.robot_model import ArmModel
from bestman_bt.runtime import Session
from bestman_bt.runtime.task_goals import KINDS, kind_judged_by
from bestman_bt.task_planning.symbolic.problem import with_article
from hal.api import Clock

Judge = Callable[[Session, Truth, Clock | None, float], Verdict]
"""Arguments: session, what is true, the clock by which the world rests first (None: judged as it is), metres driven."""


def find_judge(config: RunConfig) -> Judge | None:
    """What judges a run of the task; None where it names no predicate.

    ConfigurationError for unknown names and for what the predicates need and the task does not give.
    """
    problems = list(_problems(config))
    if problems:
        raise ConfigurationError(problems)
    return _judge if config.task.predicates else None


def _judge(session: Session, truth: Truth, clock: Clock | None, driven: float) -> Verdict:
    setup = session.setup
    before = {name: truth.object_pose(name).position for name in setup.subjects if name in truth.object_names}
    if clock is not None:
        clock.sleep(setup.config.task.tolerances.rest_time)
    tool_frame = session.skills.arm_model.tool_frame if setup.robot_model.of(ArmModel) else ""
    evidence = Evidence(setup, truth, before, driven, tool_frame)
    goals = {predicate: goal for goal in setup.asked for predicate in goal.measures}
    return joined(goals[predicate].judged(predicate, evidence) for predicate in setup.config.task.predicates)


def _problems(config: RunConfig) -> Iterator[Problem]:
    task, written = config.task, config.written.data  # fields with invalid values are reported where they are read
    for index, name in enumerate(task.predicates):
        path = ("predicate",) if isinstance(task.predicate, str) else ("predicate", index)
        kind = kind_judged_by(name)
        if kind is None:
            known = [predicate for kind in KINDS for predicate in kind.measures]
            yield config.problem(path, f"unknown predicate {name!r}; {suggestion(name, known)}")
        elif not kind.is_asked(config) and not any(written.get(field) for field in kind.fields):
            needed = with_article(kind.fields[0])
            yield config.problem(kind.fields[:1], f"is missing: the predicate {name!r} needs {needed}")
