from __future__ import annotations

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.competition_domains import DOMAINS, logistics
from bestman_bt.engine import NodeRegistry
from bestman_bt.task_planning.domain import Domain
from bestman_bt.task_planning.state import SUPERTYPES
from bestman_bt.task_planning.symbolic.facts import parse_conditions, parse_fact, parse_literals
from bestman_bt.task_planning.symbolic.fast_downward import FastDownwardPlanner, PlannerMissingError
from bestman_bt.task_planning.symbolic.grounding import ground, instantiate
from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl
from bestman_bt.task_planning.symbolic.plan_check import state_after
from bestman_bt.task_planning.symbolic.problem import (
    Fact,
    Forall,
    GoalError,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    TaskPlan,
    Unsolvable,
)
from bestman_bt.task_planning.symbolic.search import Found, RelaxedPlan, SymbolicPlanner, best_first


def operator(name, parameters, pre="", effects="", cost=1.0, hold=""):
    found = parse_conditions(effects)
    literals = [one for one in found if isinstance(one, Literal)]
    return Operator(
        name,
        parameters,
        pre=parse_conditions(pre),
        hold=parse_conditions(hold),
        add=tuple(one.fact for one in literals if not one.negated),
        delete=tuple(one.fact for one in literals if one.negated),
        each=tuple(one for one in found if isinstance(one, Forall)),
        cost=cost,
    )


PICK = operator(
    "Pick",
    {"object": "thing", "place": "place"},
    "on({object}, {place}); hand_empty; forall c - container: behind({place}, c) -> open(c)",
    "holding({object}); not on({object}, {place}); not hand_empty; forall p - place: not near(p); near({place})",
    cost=3,
)
PUT = operator(
    "Put",
    {"object": "thing", "place": "place"},
    "holding({object}); forall c - container: behind({place}, c) -> open(c)",
    "on({object}, {place}); hand_empty; not holding({object}); forall p - place: not near(p); near({place})",
    cost=3,
)
OPEN = operator("Open", {"container": "container"}, "not open({container}); hand_empty", "open({container})", cost=4)
CLOSE = operator("Close", {"container": "container"}, "open({container}); hand_empty", "not open({container})", cost=2)


def kitchen(goal, state="on(mug, drawer); on(cup, table); hand_empty", operators=(PICK, PUT, OPEN, CLOSE)):
    objects = {"mug": "thing", "cup": "thing", "table": "place", "drawer": "place", "front": "container"}
    facts = frozenset(one.fact for one in parse_literals(state + "; behind(drawer, front)"))
    return PlanningProblem(objects, facts, parse_literals(goal), operators)


def planned(problem, **parameters):
    plan = SymbolicPlanner(**parameters).plan(problem)
    state = problem.state
    for action in plan.actions:
        assert action.broken_in(state) == ()
        state = action.applied_to(state)
    assert problem.unmet_in(state) == ()
    return [str(action) for action in plan.actions]


def test_it_opens_the_drawer_takes_the_mug_and_closes_it():
    assert planned(kitchen("on(mug, table) and not open(front)")) == [
        "Open(front)",
        "Pick(mug, drawer)",
        "Put(mug, table)",
        "Close(front)",
    ]


def test_a_goal_that_holds_already_needs_no_action():
    assert planned(kitchen("on(cup, table) and not open(front)")) == []


def test_two_things_change_places_with_one_hand():
    plan = planned(kitchen("on(mug, table) and on(cup, drawer) and not open(front)"))
    assert sorted(plan) == sorted(
        ["Open(front)", "Pick(mug, drawer)", "Put(mug, table)", "Pick(cup, table)", "Put(cup, drawer)", "Close(front)"]
    )


def test_an_effect_on_all_things_of_a_type_does_not_undo_what_the_action_brings_about():
    problem = kitchen("near(table)", "on(cup, table); hand_empty; near(drawer)")
    action = instantiate(problem, PICK, ["cup", "table"])
    assert Fact("near", ("drawer",)) in action.delete
    after = action.applied_to(problem.state)
    assert Fact("near", ("table",)) in after
    assert state_after(problem, PICK, ["cup", "table"], problem.state) == after
    assert planned(problem) == ["Pick(cup, table)"]
    leave = operator("Leave", {}, "not near(table)", "gone")
    for place, can_leave in (("drawer", True), ("table", False)):  # near the table it stays there
        near = kitchen("gone and holding(cup)", f"on(cup, table); hand_empty; near({place})", (PICK, leave))
        if can_leave:
            assert planned(near) == ["Leave()", "Pick(cup, table)"]
        else:
            with pytest.raises(Unsolvable):
                planned(near)


def test_what_nothing_needs_is_left_out_of_a_plan(monkeypatch):
    problem = kitchen("on(mug, table)")
    numbers = {str(action): number for number, action in enumerate(ground(problem).actions)}
    roundabout = ("Pick(cup, table)", "Put(cup, table)", "Open(front)", "Pick(mug, drawer)", "Put(mug, table)")
    found = iter([Found(tuple(numbers[one] for one in roundabout)), Found(None), Found(None)])
    monkeypatch.setattr("bestman_bt.task_planning.symbolic.search.best_first", lambda *_, **__: next(found))
    assert planned(problem) == list(roundabout[2:])


def test_a_cheaper_plan_is_looked_for():
    long_way = [operator(f"Step{i}", {}, f"at{i}", f"at{i + 1}; not at{i}", cost=1) for i in range(3)]
    leap = operator("Leap", {}, "at0", "at3; not at0", cost=5)
    problem = PlanningProblem({}, frozenset({Fact("at0")}), (Literal(Fact("at3")),), (leap, *long_way))
    assert planned(problem) == ["Step0()", "Step1()", "Step2()"]


def test_a_search_for_a_cheaper_plan_takes_none_that_costs_as_much():
    grounded = ground(kitchen("on(mug, table)"))
    assert best_first(grounded, 1.0, 10_000, bound=10.0) == Found(None, exhausted=True)
    found = best_first(grounded, 1.0, 10_000, bound=10.1).actions
    assert found is not None
    assert sum(grounded.actions[number].cost for number in found) == 10.0


@pytest.mark.parametrize(
    ("goal", "cost"),
    [
        ("holding(cup)", 3.0),
        ("holding(mug)", 7.0),
        ("holding(mug); not on(cup, table)", 10.0),
    ],
)
def test_the_estimate_is_the_cost_of_the_actions_of_a_relaxed_plan_each_counted_once(goal, cost):
    grounded = ground(kitchen(goal))
    assert RelaxedPlan(grounded).estimate(grounded.initial).cost == cost


def test_what_must_hold_all_the_way_must_hold_at_the_start():
    carry = operator("Carry", {"object": "thing"}, hold="holding({object})", effects="carried({object})")
    problem = kitchen("carried(cup)", operators=(PICK, PUT, carry))
    assert planned(problem) == ["Pick(cup, table)", "Carry(cup)"]


def test_equality_keeps_two_parameters_apart():
    swap = Operator(
        "Swap",
        {"a": "thing", "b": "thing"},
        pre=(Literal(Fact("=", ("{a}", "{b}")), negated=True),),
        add=(Fact("swapped", ("{a}", "{b}")),),
    )
    assert planned(kitchen("swapped(mug, cup)", operators=(swap,))) == ["Swap(mug, cup)"]
    with pytest.raises(Unsolvable):
        planned(kitchen("swapped(mug, mug)", operators=(swap,)))


def test_what_nothing_brings_about_is_reported():
    with pytest.raises(Unsolvable, match=r"no action achieves that on\(mug, table\)") as raised:
        planned(kitchen("on(mug, table) and on(cup, table)", operators=(PICK, PUT, CLOSE)))
    assert raised.value.missing == (Literal(parse_fact("on(mug, table)")),)


def test_a_dead_end_behind_the_relaxation_is_unsolvable_too():
    burn = operator("Burn", {}, "match", "light; not match")
    keep = kitchen("light and match", "match", (burn,))
    with pytest.raises(Unsolvable, match="no order of actions leads to light"):
        planned(keep)


def test_a_contradictory_goal_is_refused():
    with pytest.raises(GoalError, match="contradicts itself: open"):
        planned(kitchen("open(front) and on(cup, table) and not open(front)"))


def test_the_search_ends_by_count():
    with pytest.raises(PlanningError, match="no plan among the first 1 states"):
        planned(kitchen("on(mug, table) and not open(front)"), max_evaluations=1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [501, 503])
def test_sixteen_packages_are_delivered_by_trucks_and_airplanes(tmp_path, seed):
    """Plans of more than 100 actions, in which many states have the same estimate."""
    file = tmp_path / "problem.pddl"
    file.write_text(logistics(16, np.random.default_rng([seed, 16])))
    problem = read_pddl(DOMAINS / "logistics.pddl", file)
    assert len(planned(problem, max_evaluations=1_500, hand_over=0)) > 100


@pytest.mark.slow
def test_eighty_things_are_each_brought_to_a_place():
    rng = np.random.default_rng(3)
    things, places = [f"thing_{n}" for n in range(80)], [f"place_{n}" for n in range(20)]
    domain = Domain.of(NodeRegistry())
    at = {name: str(rng.choice(places)) for name in things}
    wanted = tuple(Literal(Fact("on", (name, str(rng.choice(places))))) for name in things)
    state = {Fact("hand_empty"), Fact("tucked"), *(Fact("located", (name,)) for name in things)}
    problem = PlanningProblem(
        dict.fromkeys(things, "object") | dict.fromkeys(places, "place"),
        frozenset(state | {Fact("on", both) for both in at.items()}),
        wanted,
        domain.operators,
        SUPERTYPES,
        {name: types for name, types in domain.signatures.items() if name != "accessible"},
    )
    assert len(planned(problem, max_evaluations=1_000, hand_over=0)) >= 2 * sum(
        one.fact not in problem.state for one in wanted
    )


@pytest.mark.parametrize(("hand_over", "handed"), [(0, False), (1, True), (10_000, False)])
def test_large_problems_go_to_fast_downward_where_it_is_installed(monkeypatch, hand_over, handed):
    asked = []
    monkeypatch.setattr(FastDownwardPlanner, "plan", lambda self, problem: asked.append(problem) or TaskPlan(()))
    problem = kitchen("on(mug, table)")
    assert (SymbolicPlanner(hand_over=hand_over).plan(problem).actions == ()) == handed
    assert asked == [problem] * handed


def test_without_fast_downward_large_problems_are_planned_here(monkeypatch):
    def missing(*_):
        raise PlannerMissingError("up_fast_downward is missing")

    monkeypatch.setattr(FastDownwardPlanner, "plan", missing)
    assert planned(kitchen("on(mug, table)"), hand_over=1) == planned(kitchen("on(mug, table)"))


def test_equal_problems_give_equal_plans():
    goal = "on(mug, table) and on(cup, drawer) and not open(front)"
    assert planned(kitchen(goal)) == planned(kitchen(goal))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mug"], r"Pick takes \(object, place\), got \(mug\)"),
        (["mug", "moon"], "place is 'moon', which does not exist"),
        (["table", "table"], "object should be a thing, table is a place"),
    ],
)
def test_wrong_arguments_of_an_action_are_reported(arguments, words):
    with pytest.raises(PlanningError, match=words):
        instantiate(kitchen(""), PICK, arguments)


FACTS = [Fact(name) for name in "abcde"]
SETTINGS = st.dictionaries(st.sampled_from(FACTS), st.booleans(), max_size=3)


@st.composite
def small_problems(draw):
    """Five facts, and up to six actions that ask for some of them and change some."""

    def literals(values):
        return tuple(Literal(fact, not holds) for fact, holds in values.items())

    operators = []
    for number in range(draw(st.integers(1, 6))):
        effects = draw(SETTINGS)
        add, delete = (tuple(fact for fact, holds in effects.items() if holds is value) for value in (True, False))
        cost = float(draw(st.integers(1, 4)))
        operators.append(Operator(f"Act{number}", {}, literals(draw(SETTINGS)), add=add, delete=delete, cost=cost))
    state = frozenset(draw(st.sets(st.sampled_from(FACTS))))
    return PlanningProblem({}, state, literals(draw(SETTINGS.filter(bool))), tuple(operators))


def cheapest(problem):
    """The cost of the best plan by Dijkstra's algorithm over all states; infinite where there is none."""
    actions = [instantiate(problem, one, []) for one in problem.operators]
    queue, best, count = [(0.0, 0, problem.state)], {problem.state: 0.0}, 0
    while queue:
        cost, _, state = heapq.heappop(queue)
        if not problem.unmet_in(state):
            return cost
        for action in actions:
            after = action.applied_to(state)
            if not action.broken_in(state) and cost + action.cost < best.get(after, math.inf):
                best[after], count = cost + action.cost, count + 1
                heapq.heappush(queue, (best[after], count, after))
    return math.inf


@settings(max_examples=80, deadline=None)
@given(small_problems())
def test_what_is_planned_works_and_is_the_cheapest_after_enough_improvement(problem):
    best = cheapest(problem)
    patient = SymbolicPlanner(weights=(1.0,) * 20)
    if best == math.inf:
        with pytest.raises(Unsolvable):
            patient.plan(problem)
        return
    for planner in (SymbolicPlanner(), patient):
        plan, state = planner.plan(problem), problem.state
        for action in plan.actions:
            assert not action.broken_in(state)
            state = action.applied_to(state)
        assert not problem.unmet_in(state)
        cost = sum(action.cost for action in plan.actions)
        assert cost >= best
    assert cost == best
