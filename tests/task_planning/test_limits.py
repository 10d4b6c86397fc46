from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from bestman_bt.registry import PLANNERS, undone
from bestman_bt.task_planning.base import TaskPlanner, made_planner
from bestman_bt.task_planning.limits import LimitsExceededError, PlanLimits, plan_within
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.grounding import instantiate
from bestman_bt.task_planning.symbolic.problem import (
    Action,
    GoalError,
    PlanningError,
    PlanningProblem,
    TaskPlan,
    Unsolvable,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from tests.task_planning.language.kitchen_problem import kitchen


def fetching() -> PlanningProblem:
    return replace(kitchen(), goal=parse_literals("on(mug, table)"))


def test_without_limits_the_plan_is_the_planners() -> None:
    assert plan_within(SymbolicPlanner(), fetching(), PlanLimits()) == SymbolicPlanner().plan(fetching())


@pytest.mark.parametrize("text", ["without=drawer", "without=mug", "without=table", "only=PickUp, PutDown"])
def test_what_may_not_be_used_is_not_in_the_way_of_any_planner(text: str) -> None:
    with pytest.raises(Unsolvable):
        plan_within(SymbolicPlanner(), fetching(), PlanLimits.from_string(text))


class Inventive(TaskPlanner):
    """A planner that keeps to nothing."""

    def __init__(self, *actions: Action) -> None:
        self.actions = actions

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        return TaskPlan(self.actions)


def test_a_planner_that_keeps_to_no_limit_gets_no_plan_through() -> None:
    problem = fetching()
    opened = instantiate(problem, problem.operators[2], ["fridge"])
    with pytest.raises(LimitsExceededError, match="step 1: fridge may not be named"):
        plan_within(Inventive(opened), problem, PlanLimits.from_string("without=fridge"))
    with pytest.raises(LimitsExceededError, match="step 1: OpenContainer is not allowed"):
        plan_within(Inventive(opened), problem, PlanLimits.from_string("only=PickUp"))
    invented = replace(opened, operator=replace(opened.operator, name="OpenWithForce"))
    with pytest.raises(PlanningError, match="Inventive plans with 'OpenWithForce', which is not an ability"):
        plan_within(Inventive(invented), problem, PlanLimits())


def test_names_that_are_given_in_several_places_add_up() -> None:
    limits = PlanLimits.from_string("without=mug; only=PickUp; without=fridge; only=PutAt")
    assert limits == PlanLimits(abilities=frozenset({"PickUp", "PutAt"}), forbidden=frozenset({"mug", "fridge"}))


class Odd(TaskPlanner):
    """A planner of somebody else, that gives or raises what no planner should."""

    def __init__(self, outcome: object) -> None:
        self.outcome = outcome

    def plan(self, problem: PlanningProblem) -> TaskPlan:
        if isinstance(self.outcome, BaseException):
            raise self.outcome
        return self.outcome  # type: ignore[return-value]  # that is what is tested


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (None, "Odd should return a TaskPlan, got NoneType"),
        ([], "Odd should return a TaskPlan, got list"),
        ("PickUp", "Odd should return a TaskPlan, got str"),
        ((step for step in ()), "Odd should return a TaskPlan, got generator"),
        (TaskPlan(None), "Odd should return a TaskPlan of a tuple of Action, got None"),  # type: ignore[arg-type]
        (TaskPlan(("Search",)), "Odd should return a TaskPlan of a tuple of Action"),  # type: ignore[arg-type]
        (RuntimeError("no licence"), "Odd failed: RuntimeError: no licence"),
        (KeyError("mug"), "Odd failed: KeyError: 'mug'"),
        (SystemExit(3), "Odd failed: SystemExit: 3"),
    ],
)
def test_a_planner_that_fails_or_returns_no_plan_is_named(outcome: object, words: str) -> None:
    with pytest.raises(PlanningError, match=words):
        plan_within(Odd(outcome), fetching(), PlanLimits())


@pytest.mark.parametrize(
    ("target", "words"),
    [
        (f"{__name__}:Odd", "cannot be made: TypeError"),
        ("builtins:dict", "should be a subclass of TaskPlanner, got"),
        ("no_such_module:Odd", "cannot be imported: ModuleNotFoundError"),
    ],
)
def test_a_planner_that_cannot_be_made_is_named(target: str, words: str) -> None:
    with undone(PLANNERS):
        PLANNERS.add("odd", target)
        with pytest.raises(PlanningError, match=f"the planner 'odd' {words}"):
            made_planner("odd")


def test_of_a_thing_that_may_not_be_used_it_is_told_that_the_limits_forbid_it() -> None:
    with pytest.raises(Unsolvable, match="the limits forbid the mug") as raised:
        plan_within(SymbolicPlanner(), fetching(), PlanLimits.from_string("without=mug"))
    assert "allowed" not in str(raised.value)


def test_without_a_plan_the_limits_are_reported_beside_the_reason() -> None:
    with pytest.raises(Unsolvable, match=r"is out of reach .*, within the limits without=drawer, drawer/board$"):
        plan_within(SymbolicPlanner(), fetching(), PlanLimits.from_string("without=drawer"))
    with pytest.raises(Unsolvable) as refused:
        plan_within(SymbolicPlanner(), replace(fetching(), goal=parse_literals("behind(table, fridge)")), PlanLimits())
    assert "limits" not in str(refused.value)


def test_a_plan_at_its_limits_is_within_them() -> None:
    limits = PlanLimits.from_string("steps=3; cost=9")
    assert len(plan_within(SymbolicPlanner(), fetching(), limits)) == 3
    assert PlanLimits.from_string(" steps = 1 ; cost = 2.5e1; only = PickUp ,  PutAt ,; ") == PlanLimits(
        1, 25.0, frozenset({"PickUp", "PutAt"})
    )
    assert PlanLimits.from_string("without=a%3Db, c=d").forbidden == {"a=b", "c=d"}


def test_limits_follow_the_names_of_another_world() -> None:
    limits = PlanLimits(5, 9.0, frozenset({"PickUp"}), frozenset({"mug"}))
    assert limits.renamed({"mug": "m", "can": "c"}) == PlanLimits(5, 9.0, frozenset({"PickUp"}), frozenset({"m"}))


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"abilities": frozenset()}, "no ability is allowed"),
        ({"max_cost": 0.0}, "a cost of at most 0 is not a valid limit"),
        ({"max_cost": float("nan")}, "a cost of at most nan is not a valid limit"),
        ({"max_actions": 0}, "at most 0 steps is not a valid limit"),
    ],
)
def test_limits_that_allow_nothing_are_refused(limits: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PlanLimits(**limits)


@pytest.mark.parametrize(("text", "words"), [("steps=2", "3 steps; at most 2"), ("cost=8.5", "cost 9; at most 8.5")])
def test_a_plan_that_is_too_long_or_too_dear_is_refused(text: str, words: str) -> None:
    with pytest.raises(LimitsExceededError, match=words):
        plan_within(SymbolicPlanner(), fetching(), PlanLimits.from_string(text))


def test_the_actions_of_a_limited_plan_ask_for_facts_of_the_world_only() -> None:
    plan = plan_within(SymbolicPlanner(), fetching(), PlanLimits.from_string("without=fridge"))
    assert len(plan) == 3
    assert all(need.fact.predicate in fetching().predicates for action in plan.actions for need in action.pre)


@pytest.mark.parametrize(
    "limits",
    [
        PlanLimits(),
        PlanLimits(max_actions=3, max_cost=7.25),
        PlanLimits(max_cost=1234567.89),
        PlanLimits(max_cost=1e-7, max_actions=1),
        PlanLimits(forbidden=frozenset({"a=b"})),
        PlanLimits(abilities=frozenset({"PickUp", "PutDown"}), forbidden=frozenset({"a; b=c, d", "{goal}"})),
    ],
)
def test_limits_survive_as_text(limits: PlanLimits) -> None:
    text = limits.to_string()
    assert PlanLimits.from_string(text) == limits
    assert "{" not in text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("steps=many", "'steps=many': steps takes a number; the form is steps=20"),
        ("steps=0", "at most 0 steps is not a valid limit; it should be 1 or more"),
        ("cost=nan", "'cost=nan': cost takes a number"),
        ("cost=-1", "a cost of at most -1 is not a valid limit; it should be more than 0"),
        ("cost=dear", "'cost=dear': cost takes a number"),
        ("steps=3; steps=4", "steps is given twice, the second time by 'steps=4'"),
        ("cost=3; cost=4", "cost is given twice"),
        ("only=", "'only=' is not a limit"),
        ("without= , ", "'without= ,' is not a limit"),
        ("steps=²", "'steps=²': steps takes a number"),
        ("only=PickUp; slowly", "'slowly' is not a limit"),
    ],
)
def test_text_that_is_no_limit_is_refused(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        PlanLimits.from_string(text)


def test_a_limit_that_names_nothing_is_refused_with_the_closest_name() -> None:
    with pytest.raises(GoalError, match="unknown thing 'frige'; did you mean 'fridge'"):
        PlanLimits(forbidden=frozenset({"frige"})).resolved(kitchen())
    with pytest.raises(GoalError, match="unknown ability 'Pickup'; did you mean 'PickUp'"):
        plan_within(SymbolicPlanner(), fetching(), PlanLimits(abilities=frozenset({"Pickup"})))


def test_furniture_stands_for_all_of_it_and_a_part_for_the_parts_of_that_name() -> None:
    problem = kitchen(**{"chest/drawer_1": "container", "chest/top": "place", "desk/drawer_1": "container"})
    assert PlanLimits.from_string("without=chest").resolved(problem).forbidden == {"chest/drawer_1", "chest/top"}
    assert PlanLimits.from_string("without=drawer_1").resolved(problem).forbidden == {"chest/drawer_1", "desk/drawer_1"}
    assert PlanLimits.from_string("without=drawer").resolved(problem).forbidden == {"drawer", "drawer/board"}
    numbered = replace(problem, objects={name: kind for name, kind in problem.objects.items() if "drawer_1" in name})
    assert PlanLimits.from_string("without=drawer").resolved(numbered).forbidden == {"chest/drawer_1", "desk/drawer_1"}
