"""Why there is no plan, in words."""

from __future__ import annotations

from dataclasses import replace

from bestman_bt.engine import NodeRegistry
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.explanation import explain
from bestman_bt.task_planning.state import SUPERTYPES
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import PlanningProblem
from tests.task_planning.kitchen_domain import facts, kitchen, operator

UNLOCK = operator(
    "Unlock", {"key": "object", "container": "container"},
    "holding({key}) and fits({key}, {container})", "not locked({container})",
)  # fmt: skip


def with_keys(*more: str) -> PlanningProblem:
    """The mug is in a locked drawer, and the can is a key."""
    problem = kitchen("on(mug, table)", "locked(drawer_1)", *more, without=("on(can, table)",))
    return replace(problem, operators=(*problem.operators, UNLOCK))


def shipped(*more: str) -> PlanningProblem:
    """The shipped abilities; of the mug nobody knows where it is."""
    objects = {"mug": "object", "table": "place", "counter": "place", "drawer": "drawer"}
    state = facts("hand_empty", "tucked", "closed(drawer)", "behind(drawer, drawer)", "drawer(drawer)", *more)
    return PlanningProblem(
        objects, state, parse_literals("on(mug, table)"), Domain.of(NodeRegistry()).operators, SUPERTYPES
    )


def test_a_locked_drawer_is_named_with_the_way_from_it_to_the_goal() -> None:
    assert explain(kitchen("on(mug, table)", "locked(drawer_1)")) == (
        "locked(drawer_1) is believed, and nothing changes that: on(mug, table) is out of reach "
        "(OpenContainer(drawer_1) needs not locked(drawer_1); PickUp(mug, chest/drawer_1) needs open(drawer_1); "
        "PutAt(mug, table) needs holding(mug))"
    )


def test_a_thing_that_is_nowhere_is_what_is_missing() -> None:
    words = explain(kitchen("on(mug, table)", without=("on(mug, chest/drawer_1)",)))
    assert "on(mug, table) is out of reach" in words
    assert "PickUp(mug, chest/drawer_1) needs on(mug, chest/drawer_1)" in words


def test_parts_of_a_goal_that_exclude_each_other_are_distinguished_from_what_is_out_of_reach() -> None:
    words = explain(kitchen("on(mug, table) and on(mug, chest/drawer_2)"))
    assert words.startswith("each part of the goal is within reach alone")


def test_of_a_goal_that_holds_there_is_nothing_to_explain() -> None:
    assert explain(kitchen("on(can, table)")) == ""


def test_a_key_that_is_locked_in_with_what_it_opens_is_reported_as_a_circle() -> None:
    assert explain(with_keys("on(can, chest/drawer_1)", "fits(can, drawer_1)")) == (
        "open(drawer_1) has to hold already before it can come about: on(mug, table) is out of reach "
        "(PickUp(can, chest/drawer_1) needs open(drawer_1); Unlock(can, drawer_1) needs holding(can); "
        "OpenContainer(drawer_1) needs not locked(drawer_1); PickUp(mug, chest/drawer_1) needs open(drawer_1); "
        "PutAt(mug, table) needs holding(mug))"
    )


def test_of_two_drawers_each_with_the_key_of_the_other_the_whole_circle_is_reported() -> None:
    keys = ("on(can, chest/drawer_2)", "locked(drawer_2)", "fits(can, drawer_1)", "fits(mug, drawer_2)")
    (line,) = explain(with_keys(*keys)).splitlines()
    assert line.startswith("holding(mug) has to hold already before it can come about: on(mug, table) is out of reach")
    assert "Unlock(mug, drawer_2) needs holding(mug); OpenContainer(drawer_2) needs not locked(drawer_2)" in line


def test_a_goal_that_needs_itself_has_a_reason_too() -> None:
    words = explain(kitchen("holding(can)", without=("on(can, table)",)))
    assert words.startswith("holding(can) has to hold already before it can come about: holding(can) is out of reach")


def test_what_was_looked_for_everywhere_is_reported_with_all_the_places() -> None:
    assert explain(shipped()) == "the mug was not found at: table, counter, drawer: on(mug, table) is out of reach"


def test_where_it_may_still_be_is_reported_with_what_keeps_one_from_looking() -> None:
    assert explain(shipped("unseen(mug, drawer)", "locked(drawer)")) == (
        "locked(drawer) is believed, and nothing changes that: on(mug, table) is out of reach "
        "(OpenContainer(drawer) needs not locked(drawer); Search(mug, drawer) needs open(drawer))"
    )
