"""``facts``: what the task wants to come about, as facts, is true; whatever the robot believes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from bestman_bt.configuration import Problem, RunConfig
from bestman_bt.evaluation.predicates.standing import is_over, rest_faults, tilt_fault
from bestman_bt.evaluation.predicates.verdict import Evidence, Verdict, joined
from bestman_bt.registry import suggestion
from bestman_bt.task_planning.symbolic import GoalError, Literal
from bestman_bt.task_planning.symbolic.facts import parse_goal
from bestman_bt.world_model import leaf_called, openness_of


def facts(evidence: Evidence) -> Verdict:
    """Each fact of the goal that can be judged, by the true state; of the others the robot's own word counts.

    Metrics: ``facts_judged``, how many these are; ``facts_share``, how many of them hold.

    ``on``: let go, at rest, above that surface and, but in a drawer, upright. ``open``, ``closed``: by the openings
    that skills go by. ``holding``: by what touches the robot and stands on nothing; ``hand_empty``: the robot presses
    on nothing. A fact that shall not be is held to its own measure: ``not on`` wants it off the surface, not just
    badly put down.
    """
    verdicts = [_judged(evidence, literal) for literal in evidence.session.setup.plan_goal if can_be_judged(literal)]
    both = joined(verdicts)
    share = sum(verdict.holds for verdict in verdicts) / len(verdicts)
    return Verdict(both.holds, both.why, {"facts_judged": len(verdicts), "facts_share": share})


def can_be_judged(literal: Literal) -> bool:
    """Whether it is about the world; of the robot's beliefs alone nothing is true or false."""
    return literal.fact.predicate in _JUDGED


def fact_problems(config: RunConfig) -> Iterator[Problem]:
    """Goals of which no fact can be judged."""
    assert config.task.plan is not None
    try:
        literals = parse_goal(config.task.plan.goal)
    except GoalError as error:
        yield config.problem(("plan", "goal"), str(error))
        return
    if any(can_be_judged(one) or one.fact.predicate == "accessible" for one in literals):  # which stands for open ones
        return
    for literal in literals:
        message = f"{literal} cannot be judged; {suggestion(literal.fact.predicate, list(_JUDGED))}"
        yield config.problem(("plan", "goal"), message)


def _judged(evidence: Evidence, literal: Literal) -> Verdict:
    wanted, unwanted = _JUDGED[literal.fact.predicate]
    fault = (unwanted if literal.negated else wanted)(evidence, *literal.fact.arguments)
    return Verdict(not fault, fault)


def _not_on(evidence: Evidence, name: str, place: str) -> str:
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    faults = [] if is_over(evidence, name, place) else [f"not on {place}"]
    faults += rest_faults(evidence, name, place)
    if evidence.session.setup.world_model.map.surface(place)[1].leaf is None:
        faults += tilt_fault(evidence, evidence.truth.object_pose(name))
    return f"the {name} is " + ", ".join(faults) if faults else ""


def _still_on(evidence: Evidence, name: str, place: str) -> str:
    """It is not off a surface while it is above it, however it lies, or touches the piece and no other surface of it;
    in the hand it is.
    """
    if name not in evidence.before or _is_held(evidence, name):
        return ""
    if is_over(evidence, name, place):
        return f"the {name} is on {place}"
    piece, _ = evidence.session.setup.world_model.map.surface(place)
    if any(is_over(evidence, name, f"{piece.name}/{other.name}") for other in piece.surfaces):
        return ""
    return f"the {name} touches the {piece.name}" if piece.name in evidence.truth.supports(name) else ""


def _not_held(evidence: Evidence, name: str) -> str:
    if name not in evidence.before:
        return f"there is no {name} in the scene"
    return "" if _is_held(evidence, name) else f"the {name} is not in the hand"


def _is_held(evidence: Evidence, name: str) -> bool:
    return evidence.truth.touches_robot(name) and not evidence.truth.supports(name)


def _pressed(evidence: Evidence, name: str) -> str:
    """The hand has not let go of what the robot presses on, though it stands on something."""
    if name not in evidence.before or not evidence.truth.touches_robot(name):
        return ""
    return f"the hand holds the {name}" if _is_held(evidence, name) else f"the robot presses on the {name}"


def _hand_not_empty(evidence: Evidence) -> str:
    pressed = [name for name in evidence.truth.object_names if evidence.truth.touches_robot(name)]
    if not pressed:
        return ""
    held = [name for name in pressed if _is_held(evidence, name)]
    return f"the hand holds the {held[0]}" if held else f"the robot presses on the {pressed[0]}"


def _hand_empty(evidence: Evidence) -> str:
    held = any(_is_held(evidence, name) for name in evidence.truth.object_names)
    return "" if held else "the hand holds nothing"


def _not_open(evidence: Evidence, container: str) -> str:
    return "" if _is_open(evidence, container) else f"the {container} is not open"


def _still_open(evidence: Evidence, container: str) -> str:
    return f"the {container} is open" if _is_open(evidence, container) else ""


def _is_open(evidence: Evidence, container: str) -> bool:
    enough = openness_of(leaf_called(evidence.session.setup.world_model, container)).enough
    return evidence.truth.articulation_position(container) >= enough


def _not_shut(evidence: Evidence, container: str) -> str:
    return "" if _is_shut(evidence, container) else f"the {container} is not shut"


def _still_shut(evidence: Evidence, container: str) -> str:
    return f"the {container} is shut" if _is_shut(evidence, container) else ""


def _is_shut(evidence: Evidence, container: str) -> bool:
    shut = openness_of(leaf_called(evidence.session.setup.world_model, container)).shut
    return evidence.truth.articulation_position(container) <= shut


_JUDGED: dict[str, tuple[Callable[..., str], Callable[..., str]]] = {
    "on": (_not_on, _still_on),
    "holding": (_not_held, _pressed),
    "hand_empty": (_hand_not_empty, _hand_empty),
    "open": (_not_open, _still_open),
    "closed": (_not_shut, _still_shut),
}
"""Predicate → what keeps a fact, and what keeps its negation, from being true, in words; empty where nothing does."""
