"""A small kitchen for the tests of trees, plans and their verification: two drawers, a table, two objects."""

from __future__ import annotations

from bestman_bt.task_planning.symbolic.facts import parse_conditions, parse_fact, parse_literals
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import Fact, Operator, PlanningProblem, TaskPlan


def operator(
    name: str, parameters: dict[str, str], pre: str, effects: str, hold: str = "", parts: str = ""
) -> Operator:
    """An operator in the words of a declaration."""
    literals = parse_literals(effects)
    return Operator(
        name,
        parameters,
        parse_conditions(pre),
        parse_conditions(hold),
        tuple(literal.fact for literal in literals if not literal.negated),
        tuple(literal.fact for literal in literals if literal.negated),
        parts=tuple(parts.split()),
    )


ACCESSIBLE = "forall c - container: behind({place}, c) -> open(c)"
THING, PLACE, DOOR = {"object": "object"}, {"place": "place"}, {"container": "container"}
OPERATORS = (
    operator(
        "PickUp",
        {**THING, **PLACE},
        f"on({{object}}, {{place}}) and hand_empty and {ACCESSIBLE}",
        "holding({object}) and not on({object}, {place}) and not hand_empty and not tucked",
        parts="arm base",
    ),
    operator(
        "PutAt",
        {**THING, **PLACE},
        f"holding({{object}}) and {ACCESSIBLE}",
        "on({object}, {place}) and hand_empty and not holding({object}) and not tucked",
        hold=ACCESSIBLE,
        parts="arm base",
    ),
    operator("OpenContainer", DOOR, "hand_empty and not open({container}) and not locked({container})",
             "open({container}) and not tucked", parts="arm base"),
    operator("CloseContainer", DOOR, "hand_empty and open({container})",
             "not open({container}) and not tucked", parts="arm base"),
    operator("GoTo", PLACE, "not near({place})", "near({place})", parts="base"),
    operator("TuckArm", {}, "not tucked", "tucked", parts="arm"),
)  # fmt: skip
OBJECTS = {
    "mug": "object",
    "can": "object",
    "table": "place",
    "chest/drawer_1": "place",
    "chest/drawer_2": "place",
    "drawer_1": "container",
    "drawer_2": "container",
}
STATE = ("on(mug, chest/drawer_1)", "on(can, table)", "hand_empty")
BEHIND = ("behind(chest/drawer_1, drawer_1)", "behind(chest/drawer_2, drawer_2)")


def facts(*texts: str) -> frozenset[Fact]:
    """Facts from text."""
    return frozenset(parse_fact(text) for text in texts)


def kitchen(goal: str, *more: str, without: tuple[str, ...] = ()) -> PlanningProblem:
    """The problem of a goal; ``more``: facts that hold, too; ``without``: those that do not."""
    state = facts(*STATE, *BEHIND, *more) - facts(*without)
    return PlanningProblem(OBJECTS, state, parse_literals(goal), OPERATORS)


def plan_of(problem: PlanningProblem, *actions: str) -> TaskPlan:
    """A plan from text: ``PickUp(mug, table)``."""
    named = {operator.name: operator for operator in problem.operators}
    calls = [parse_fact(action) for action in actions]
    return TaskPlan(tuple(instantiate(problem, named[call.predicate], call.arguments) for call in calls))


FETCH_GOAL = "on(mug, table) and not open(drawer_1)"
FETCH = (
    "OpenContainer(drawer_1)",
    "PickUp(mug, chest/drawer_1)",
    "PutAt(mug, table)",
    "CloseContainer(drawer_1)",
)
"""Fetch the mug from the closed drawer, and close it."""
