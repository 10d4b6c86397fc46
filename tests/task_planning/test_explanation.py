"""Why there is no plan, in words."""

from __future__ import annotations

from bestman_bt.task_planning.explanation import explain
from tests.task_planning.kitchen_domain import kitchen


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


def test_parts_of_a_goal_that_exclude_each_other_are_told_apart_from_what_is_out_of_reach() -> None:
    words = explain(kitchen("on(mug, table) and on(mug, chest/drawer_2)"))
    assert words.startswith("each part of the goal is within reach alone")


def test_of_a_goal_that_holds_there_is_nothing_to_explain() -> None:
    assert explain(kitchen("on(can, table)")) == ""
