"""``facts``: what the task wants to come about, as facts, is true; whatever the robot believes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.evaluation.predicates.standing import is_over, rest_faults, tilt_fault
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined
from bestman_bt.registry import suggestion
from bestman_bt.task_planning.symbolic import GoalError, Literal
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.world_model import leaf_called, openness_of


def facts(evidence: Evidence) -> Verdict:
    """Each fact of the goal by the true state; metric ``facts_share``: how many of them hold.

    ``on``: let go, at rest, above that surface and, but in a drawer, upright. ``open``, ``closed``: by the openings
    that skills go by. ``holding``, ``hand_empty``: by what touches the robot and stands on nothing.
    """
    verdicts = [_judged(evidence, literal) for literal in evidence.session.setup.plan_goal]
    both = joined(verdicts)
    share = sum(verdict.holds for verdict in verdicts) / len(verdicts) if verdicts else 1.0
    return Verdict(both.holds, both.why, {"facts_share": share})


def fact_problems(config: RunConfig) -> Iterator[Problem]:
    """Facts that are about the robot's beliefs alone: nothing is true or false of them."""
    assert config.task.plan is not None
    try:
        literals = parse_literals(config.task.plan.goal)
    except GoalError as error:
        yield config.problem(("plan", "goal"), str(error))
        return
    for literal in literals:
        name = literal.fact.predicate
        if name not in _FAULTS and name != "accessible":  # which stands for open ones
            message = f"{literal} cannot be judged; {suggestion(name, [*_FAULTS, 'accessible'])}"
            yield config.problem(("plan", "goal"), message)


def objects_of(goal: Iterable[Literal]) -> list[str]:
    """The objects whose place is judged."""
    return [literal.fact.arguments[0] for literal in goal if literal.fact.predicate in ("on", "holding")]


def _judged(evidence: Evidence, literal: Literal) -> Verdict:
    fault = _FAULTS[literal.fact.predicate](evidence, *literal.fact.arguments)
    if literal.negated:
        return Verdict(bool(fault), "" if fault else f"it is so that {literal.fact}")
    return Verdict(not fault, fault)


def _on(evidence: Evidence, name: str, place: str) -> str:
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    faults = [] if is_over(evidence, name, place) else [f"not on {place}"]
    faults += rest_faults(evidence, name, place)
    if evidence.session.setup.world_model.map.surface(place)[1].leaf is None:
        faults += tilt_fault(evidence, evidence.truth.object_pose(name))
    return f"the {name} is " + ", ".join(faults) if faults else ""


def _holding(evidence: Evidence, name: str) -> str:
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    return "" if _is_held(evidence, name) else f"the {name} is not in the hand"


def _hand_empty(evidence: Evidence) -> str:
    held = [name for name in evidence.truth.object_names if _is_held(evidence, name)]
    return f"the hand holds the {held[0]}" if held else ""


def _is_held(evidence: Evidence, name: str) -> bool:
    return evidence.truth.touches_robot(name) and not evidence.truth.supports(name)


def _open(evidence: Evidence, container: str) -> str:
    enough = openness_of(leaf_called(evidence.session.setup.world_model, container)).enough
    return "" if evidence.truth.articulation_position(container) >= enough else f"the {container} is not open"


def _closed(evidence: Evidence, container: str) -> str:
    shut = openness_of(leaf_called(evidence.session.setup.world_model, container)).shut
    return "" if evidence.truth.articulation_position(container) <= shut else f"the {container} is not shut"


_FAULTS: dict[str, Callable[..., str]] = {
    "on": _on,
    "holding": _holding,
    "hand_empty": _hand_empty,
    "open": _open,
    "closed": _closed,
}
"""Predicate → what keeps a fact from being true, in words; empty where nothing does."""
