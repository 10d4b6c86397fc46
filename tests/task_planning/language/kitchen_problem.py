"""A small kitchen: a mug in a shut drawer, a can on the counter, a table."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from bestman_bt.task_planning.symbolic.facts import parse_conditions, parse_fact, parse_literals
from bestman_bt.task_planning.symbolic.problem import Forall, Operator, PlanningProblem

INSTRUCTION = "bring the mug from the drawer to the table"
GOAL = ["on(mug, table)"]


def operator(name: str, parameters: dict[str, str], pre: str, effects: str, cost: float = 1.0) -> Operator:
    literals = parse_literals(effects)
    return Operator(
        name,
        parameters,
        parse_conditions(pre),
        add=tuple(literal.fact for literal in literals if not literal.negated),
        delete=tuple(literal.fact for literal in literals if literal.negated),
        cost=cost,
    )


REACHABLE = "forall c - container: behind({place}, c) -> open(c)"
OPERATORS = (
    operator(
        "PickUp",
        {"object": "object", "place": "place"},
        f"on({{object}}, {{place}}) and hand_empty and {REACHABLE}",
        "holding({object}) and not on({object}, {place}) and not hand_empty",
        3.0,
    ),
    operator(
        "PutDown",
        {"object": "object", "place": "place"},
        f"holding({{object}}) and {REACHABLE}",
        "on({object}, {place}) and hand_empty and not holding({object})",
        2.0,
    ),
    operator(
        "OpenContainer", {"container": "container"}, "not open({container}) and hand_empty", "open({container})", 4.0
    ),
    operator(
        "CloseContainer", {"container": "container"}, "open({container}) and hand_empty", "not open({container})", 4.0
    ),
    operator("TuckArm", {}, "", "tucked"),
)
PREDICATES = {
    "on": ("object", "place"),
    "holding": ("object",),
    "hand_empty": (),
    "open": ("container",),
    "behind": ("place", "container"),
    "tucked": (),
}
FACTS = ("on(mug, drawer/board)", "on(can, counter)", "hand_empty", "behind(drawer/board, drawer)")


def kitchen(**things: str) -> PlanningProblem:
    """The problem; ``things``: more of them, name → type."""
    assert isinstance(OPERATORS[0].pre[-1], Forall)
    objects = {"mug": "object", "can": "object", "table": "place", "counter": "place", "drawer/board": "place"}
    objects = {**objects, "drawer": "container", "fridge": "container", **things}
    state = frozenset(map(parse_fact, FACTS))
    return PlanningProblem(objects, state, (), OPERATORS, predicates=PREDICATES, instruction=INSTRUCTION)


def renamed(problem: PlanningProblem, old: str, new: str) -> PlanningProblem:
    """The problem with a thing called otherwise."""
    names = {old: new}
    return replace(
        problem,
        objects={names.get(name, name): kind for name, kind in problem.objects.items()},
        state=frozenset(fact.bound(names) for fact in problem.state),
    )


def step(ability: str, **arguments: str) -> dict[str, Any]:
    return {"ability": ability, "arguments": arguments}


FETCH = [
    step("OpenContainer", container="drawer"),
    step("PickUp", object="mug", place="drawer/board"),
    step("PutDown", object="mug", place="table"),
]


def answer(plan: list[dict[str, Any]], goal: list[str] | None = None, refusal: str | None = None) -> dict[str, Any]:
    return {"refusal": refusal, "goal": GOAL if goal is None else goal, "plan": plan}


RIGHT = answer(FETCH)
