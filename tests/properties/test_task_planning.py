"""What holds for each task planner: judged by a search through all states, with conditions read as they are written."""

from __future__ import annotations

import heapq
import itertools
import math
import re

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from bestman_bt.engine import SUCCESS, NodeRegistry
from bestman_bt.task_planning.builders.backchain import BackchainBuilder
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.task_planning.simulation import SymbolicWorld, dry_run
from bestman_bt.task_planning.symbolic.grounding import ground, instantiate
from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl
from bestman_bt.task_planning.symbolic.pddl_writing import PddlText
from bestman_bt.task_planning.symbolic.plan_check import broken_in, state_after
from bestman_bt.task_planning.symbolic.problem import (
    Fact,
    Forall,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    Unsolvable,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from tests.properties.profile import examples

OBJECTS = {"a": "thing", "b": "thing", "c": "box"}
ARITY = {"p": 1, "q": 2, "r": 0, "still": 1}
"""``still`` never changes unless an example lets an operator change it."""
KINDS = st.sampled_from(["thing", "box"])


def facts(names, predicates=tuple(ARITY)):
    made = {
        predicate: st.tuples(*[st.sampled_from(names)] * ARITY[predicate]).map(lambda args, p=predicate: Fact(p, args))
        for predicate in predicates
    }
    return st.one_of(*made.values())


def literals(names, predicates=tuple(ARITY)):
    return st.builds(Literal, facts(names, predicates), st.booleans())


def foralls(names, predicates=tuple(ARITY), given_of=("still",)):
    inside = [*names, "{each}"]
    given_fact = st.one_of(st.none(), facts(inside, given_of))
    return st.builds(Forall, st.just("{each}"), KINDS, given_fact, literals(inside, predicates))


@st.composite
def operators(draw, name, given_of=("still",)):
    kinds = draw(st.lists(KINDS, max_size=2))
    parameters = {f"x{number}": kind for number, kind in enumerate(kinds)}
    names = [*OBJECTS, *(f"{{{port}}}" for port in parameters)]
    changed = ("p", "q", "r")
    pre = draw(st.lists(st.one_of(literals(names), foralls(names, given_of=given_of)), max_size=3))
    effects = draw(
        st.lists(st.one_of(literals(names, changed), foralls(names, changed, given_of)), min_size=1, max_size=3)
    )
    plain = [one for one in effects if isinstance(one, Literal)]
    return Operator(
        name,
        parameters,
        tuple(pre),
        add=tuple(one.fact for one in plain if not one.negated),
        delete=tuple(one.fact for one in plain if one.negated),
        each=tuple(one for one in effects if isinstance(one, Forall)),
        cost=draw(st.sampled_from([0.0, 1.0, 2.0, 5.0])),
    )


@st.composite
def problems(draw, given_of=("still",)):
    made = tuple(draw(operators(f"act{number}", given_of)) for number in range(draw(st.integers(1, 3))))
    state = draw(st.frozensets(facts(list(OBJECTS)), max_size=5))
    goal = draw(st.lists(literals(list(OBJECTS)), min_size=1, max_size=3))
    goal = {literal.fact: literal for literal in goal}.values()
    types = {"p": ("object",), "q": ("object", "object"), "r": (), "still": ("object",)}
    return PlanningProblem(OBJECTS, state, tuple(goal), made, {"thing": ("object",), "box": ("object",)}, types)


def instances(problem):
    for operator in problem.operators:
        kinds = operator.parameters.values()
        yield from ((operator, args) for args in itertools.product(*map(problem.of_type, kinds)))


def cheapest(problem):
    """What the cheapest plan costs, infinite where there is none: Dijkstra's algorithm over states."""
    queue, best, number = [(0.0, 0, problem.state)], {problem.state: 0.0}, 0
    while queue:
        cost, _, state = heapq.heappop(queue)
        if all(goal.holds_in(state) for goal in problem.goal):
            return cost
        if cost > best[state]:
            continue
        for operator, arguments in instances(problem):
            if not broken_in(problem, operator, arguments, state):
                after = state_after(problem, operator, arguments, state)
                if cost + operator.cost < best.get(after, math.inf):
                    best[after], number = cost + operator.cost, number + 1
                    heapq.heappush(queue, (best[after], number, after))
    return math.inf


def check(problem, planner):
    """A plan can be carried out and reaches the goal; none is found only where there is none."""
    try:
        plan = planner.plan(problem)
    except Unsolvable:
        assert cheapest(problem) == math.inf
        return
    state = problem.state
    for action in plan.actions:
        assert not broken_in(problem, action.operator, action.arguments, state)
        state = state_after(problem, action.operator, action.arguments, state)
    assert all(goal.holds_in(state) for goal in problem.goal)
    assert cheapest(problem) <= plan.cost


@examples(60)
@given(problems())
def test_a_plan_reaches_the_goal_and_none_is_missed(problem):
    check(problem, SymbolicPlanner())


TAKEN_FOR_GRANTED = PlanningProblem(
    OBJECTS,
    frozenset(),
    (Literal(Fact("r")),),
    (
        Operator("put", add=(Fact("p", ("a",)),)),
        Operator(
            "finish",
            pre=(
                Literal(Fact("p", ("a",))),
                Forall("{each}", "thing", Fact("p", ("{each}",)), Literal(Fact("still", ("{each}",)))),
            ),
            add=(Fact("r"),),
        ),
    ),
)
"""There is no plan: what was put must be still. At the start nothing was put."""


@pytest.mark.slow
@examples(60)
@example(TAKEN_FOR_GRANTED)
@given(problems(given_of=("p", "q", "still")))
def test_a_forall_that_depends_on_what_changes_is_refused_with_its_name(problem):
    if not problem.unsound:
        check(problem, SymbolicPlanner())
        return
    with pytest.raises(PlanningError, match=re.escape(problem.unsound)):
        SymbolicPlanner().plan(problem)
    named = next(one for one in problem.operators if one.name == problem.unsound.partition(":")[0])
    assert any(one.given.predicate in ("p", "q") for one in named.assumed)


@pytest.mark.slow
@examples(60)
@given(problems())
def test_the_join_finds_the_actions_that_trying_all_things_finds_and_in_their_order(problem):
    waiting = [instantiate(problem, operator, arguments) for operator, arguments in instances(problem)]
    every, reached = list(waiting), set()
    while ready := [one for one in waiting if all(n in reached or n.holds_in(problem.state) for n in one.pre)]:
        waiting = [one for one in waiting if one not in ready]
        reached |= {effect for one in ready for effect in one.effects}
    try:
        found = ground(problem).actions
    except Unsolvable:
        assert any(not goal.holds_in(problem.state) and goal not in reached for goal in problem.goal)
        return
    assert list(found) == [one for one in every if one not in waiting]


@pytest.mark.slow
@examples(40)
@given(problems(), st.randoms())
def test_the_order_of_objects_and_operators_decides_nothing_but_among_equals(problem, random):
    things, made = list(problem.objects.items()), list(problem.operators)
    random.shuffle(things)
    random.shuffle(made)
    mixed = PlanningProblem(
        dict(things), problem.state, problem.goal, tuple(made), problem.supertypes, problem.predicates
    )

    def found(one):
        try:
            return bool(SymbolicPlanner().plan(one) is not None)
        except Unsolvable:
            return False

    assert found(problem) == found(mixed)


@pytest.mark.slow
@examples(40)
@given(problem=problems())
def test_what_is_written_in_pddl_and_read_again_has_a_plan_where_the_problem_has_one(problem, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    text = PddlText(problem)
    (folder / "domain.pddl").write_text(text.domain())
    (folder / "problem.pddl").write_text(text.problem())
    again = read_pddl(folder / "domain.pddl", folder / "problem.pddl")
    assert cheapest(again) == cheapest(problem)


@pytest.mark.slow
@examples(20)
@given(problems())
def test_the_tree_of_each_builder_reaches_the_goal(problem):
    try:
        plan = SymbolicPlanner().plan(problem)
    except Unsolvable:
        assume(False)
    for builder in (SequenceBuilder(), ReactiveBuilder(), BackchainBuilder()):
        run = dry_run(builder.build(plan, problem.goal).document().to_xml(), SymbolicWorld(problem), NodeRegistry())
        assert (run.status, run.reached) == (SUCCESS, True)
