"""Where a plan stands, whatever has been done so far."""

from __future__ import annotations

import pytest

from bestman_bt.task_planning.nodes import PlanMonitor
from tests.task_planning.kitchen_domain import FETCH, FETCH_GOAL, facts, kitchen, plan_of


@pytest.fixture(scope="module")
def monitor() -> PlanMonitor:
    """Of the plan that fetches the mug from the drawer."""
    problem = kitchen(FETCH_GOAL)
    return PlanMonitor(plan_of(problem, *FETCH), problem.goal)


def test_the_last_action_that_is_ready_comes_next(monitor: PlanMonitor) -> None:
    assert str(monitor.assess(kitchen(FETCH_GOAL).state)) == "next is OpenContainer(drawer_1)"
    assert str(monitor.assess(facts("holding(mug)", "open(drawer_1)"))) == "next is PutAt(mug, table)"


def test_it_is_done_where_the_goal_is_believed(monitor: PlanMonitor) -> None:
    assert monitor.assess(facts("on(mug, table)")).done
    assert str(monitor.assess(facts("on(mug, table)"))) == "the goal holds"


def test_where_the_plan_does_not_help_it_reports_what_is_missing(monitor: PlanMonitor) -> None:
    moved = facts("on(mug, chest/drawer_2)", "hand_empty", "open(drawer_1)")
    assert str(monitor.assess(moved)) == "the plan no longer helps: it needs on(mug, chest/drawer_1)"
