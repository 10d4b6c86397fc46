"""The predicates by name, and how those of a task judge a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from bestman_bt.configuration import ConfigurationError, Problem, RunConfig
from bestman_bt.evaluation.predicates.at_goal import at_goal
from bestman_bt.evaluation.predicates.facts import fact_problems, facts
from bestman_bt.evaluation.predicates.inside import inside
from bestman_bt.evaluation.predicates.lifted import lifted
from bestman_bt.evaluation.predicates.opened import opened
from bestman_bt.evaluation.predicates.placed import placed
from bestman_bt.evaluation.predicates.tidied import tidied
from bestman_bt.evaluation.predicates.tool_at import tool_at
from bestman_bt.evaluation.predicates.verdict import Evidence, Predicate, Verdict, joined
from bestman_bt.registry import suggestion
from bestman_bt.runtime import Session, Setup
from hal.api import Clock
from hal.simulation import GroundTruth

PREDICATES: dict[str, Predicate] = {
    "at_goal": at_goal,
    "facts": facts,
    "inside": inside,
    "lifted": lifted,
    "opened": opened,
    "placed": placed,
    "tidied": tidied,
    "tool_at": tool_at,
}
_NEEDS = {
    "at_goal": "drive",
    "facts": "plan",
    "inside": "goal",
    "lifted": "lift",
    "opened": "opening",
    "placed": "goal",
    "tidied": "tidy",
    "tool_at": "reach",
}
METRICS: dict[str, tuple[str, ...]] = {
    "at_goal": ("final_error_mm", "final_yaw_deg", "path_ratio"),
    "facts": ("facts_judged", "facts_share"),
    "inside": (),
    "lifted": ("lifted_mm",),
    "opened": ("angle_deg", "opening_mm"),
    "placed": ("place_error_mm", "tilt_deg", "yaw_error_deg"),
    "tidied": ("outside_mm", "tidied_share"),
    "tool_at": ("tool_error_mm", "tool_error_deg"),
}
"""What each predicate may measure; of several goals also one by one, the object's name behind."""

Judge = Callable[[Session, GroundTruth, Clock | None, float], Verdict]
"""Arguments: session, ground truth, the clock by which the world rests first (None: judged as it is), metres driven."""


def find_judge(config: RunConfig) -> Judge | None:
    """What judges a run of the task; None where it names no predicate.

    ConfigurationError for unknown names and for what the predicates need and the task does not give.
    """
    problems = list(_problems(config))
    if problems:
        raise ConfigurationError(problems)
    predicates = [PREDICATES[name] for name in config.task.predicates]
    if not predicates:
        return None

    def judge(session: Session, truth: GroundTruth, clock: Clock | None, driven: float) -> Verdict:
        there = truth.object_names
        before = {name: truth.object_pose(name) for name in subjects(session.setup) if name in there}
        if clock is not None:
            clock.sleep(session.setup.config.task.tolerances.rest_time)
        positions = {name: tuple(float(x) for x in pose.position) for name, pose in before.items()}
        evidence = Evidence(session, truth, {name: (x, y, z) for name, (x, y, z) in positions.items()}, driven)
        return joined(predicate(evidence) for predicate in predicates)

    return judge


def subjects(setup: Setup) -> list[str]:
    """The objects, doors and drawers whose state the task's goal is about."""
    tidy, lift, opening = setup.config.task.tidy, setup.config.task.lift, setup.config.task.opening
    named = [*(goal.object for goal in setup.goals), *(tidy.objects if tidy is not None else ())]
    named += [lift.object] if lift is not None else []
    named += [opening.articulation] if opening is not None else []
    named += [name for literal in setup.plan_goal for name in literal.fact.arguments[:1]]
    return list(dict.fromkeys(named))


def metric_names(config: RunConfig) -> list[str]:
    """What the judge of a task may measure."""
    names = [name for predicate in config.task.predicates for name in METRICS.get(predicate, ())]
    goals = config.task.goals if len(config.task.goals) > 1 else ()
    objects = [o for goal in goals for o in ((goal.object,) if isinstance(goal.object, str) else goal.object)]
    return [*names, *(f"{name}_{thing}" for name in METRICS["placed"] if name in names for thing in objects)]


def _problems(config: RunConfig) -> Iterator[Problem]:
    task, written = config.task, config.written.data  # what is written but wrong is told by others
    given: dict[str, bool] = {
        name: getattr(task, name) is not None or written.get(name) is not None
        for name in ("opening", "tidy", "reach", "lift", "drive", "plan")
    }
    given["goal"] = bool(task.all_goals or written.get("goal") or written.get("goals"))
    for index, name in enumerate(task.predicates):
        path = ("predicate",) if isinstance(task.predicate, str) else ("predicate", index)
        if name not in PREDICATES:
            yield config.problem(path, f"unknown predicate {name!r}; {suggestion(name, list(PREDICATES))}")
        elif not given[_NEEDS[name]]:
            article = "an" if _NEEDS[name] == "opening" else "a"
            needed = "a goal" if _NEEDS[name] == "goal" else f"{article} {_NEEDS[name]}"
            yield config.problem((_NEEDS[name],), f"is missing: the predicate {name!r} needs {needed}")
        elif name == "facts":
            yield from fact_problems(config)
