"""Random problems of ``:adl`` in PDDL text: judged by a search through all states with an evaluator of its own."""

from __future__ import annotations

import itertools
from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bestman_bt.task_planning.symbolic.grounding import ground
from bestman_bt.task_planning.symbolic.pddl_reading import read_pddl
from bestman_bt.task_planning.symbolic.pddl_writing import PddlText
from bestman_bt.task_planning.symbolic.plan_check import broken_in, state_after
from bestman_bt.task_planning.symbolic.problem import (
    Fact,
    GoalError,
    Joined,
    Literal,
    Operator,
    PlanningProblem,
    Unsolvable,
    When,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from bestman_bt.task_planning.symbolic.strips_plan import as_strips
from tests.properties.profile import examples

OBJECTS = {"a": "thing", "b": "thing", "c": "box"}
ARITY = {"p": 1, "q": 1, "r": 0, "link": 2}
"""``link`` never changes."""
KINDS = st.sampled_from(["thing", "thing", "box", "object", "none"])
"""``none``: of no object."""

VARIABLES = st.sampled_from(["?y", "?x0", "?x0"])


def atoms(names, predicates):
    return st.one_of(*(st.tuples(st.just(one), *[st.sampled_from(names)] * ARITY[one]) for one in predicates))


@st.composite
def formulas(draw, names, depth=4):
    """A formula as nested tuples, as PDDL writes it."""
    leaf = st.one_of(atoms(names, ARITY), st.tuples(st.just("="), st.sampled_from(names), st.sampled_from(names)))
    word = draw(st.sampled_from(["leaf", "leaf", "not", "and", "or", "imply", "forall", "exists"]))
    if depth == 0 or word == "leaf":
        return draw(leaf)
    if word in ("forall", "exists"):
        variable = draw(VARIABLES)
        return (word, ((variable, draw(KINDS)),), draw(formulas([*names, variable], depth - 1)))
    count = {"not": 1, "imply": 2}.get(word) or draw(st.integers(0, 3))
    return (word, *(draw(formulas(names, depth - 1)) for _ in range(count)))


@st.composite
def effects(draw, names, depth=4):
    word = draw(st.sampled_from(["leaf", "when", "forall", "forall", "and"]))
    if depth == 0 or word == "leaf":
        atom = draw(atoms(names, ("p", "q", "r")))
        return draw(st.sampled_from([atom, ("not", atom)]))
    if word == "when":
        return (word, draw(formulas(names, 2)), draw(effects(names, depth - 1)))
    if word == "forall":
        variable = draw(VARIABLES)
        return (word, ((variable, draw(KINDS)),), draw(effects([*names, variable], depth - 1)))
    return ("and", *draw(st.lists(effects(names, depth - 1), min_size=1, max_size=3)))


@st.composite
def actions(draw, name):
    parameters = tuple((f"?x{number}", kind) for number, kind in enumerate(draw(st.lists(KINDS, max_size=2))))
    names = ["a", *(variable for variable, _ in parameters)]
    return name, parameters, draw(formulas(names)), ("and", *draw(st.lists(effects(names), min_size=1, max_size=3)))


@st.composite
def problems(draw):
    made = [draw(actions(f"act{number}")) for number in range(draw(st.integers(1, 3)))]
    state = draw(st.frozensets(atoms(list(OBJECTS), ARITY), max_size=5))
    return made, state, draw(formulas(list(OBJECTS)))


def text(part):
    """Nested tuples as PDDL; a pair of a variable and a type inside a quantifier's list has a dash."""
    if isinstance(part, str):
        return part
    if part and part[0] in ("forall", "exists"):
        return f"({part[0]} ({typed(part[1])}) {text(part[2])})"
    return f"({' '.join(map(text, part))})"


def typed(pairs):
    return " ".join(f"{name} - {kind}" for name, kind in pairs)


def read(problem, folder):
    made, state, goal = problem
    lines = ["(define (domain d) (:requirements :adl) (:types thing box none - object) (:constants a - thing)"]
    lines.append("(:predicates (p ?x) (q ?x) (r) (link ?x ?y))")
    for name, parameters, pre, effect in made:
        lines.append(f"(:action {name} :parameters ({typed(parameters)})")
        lines.append(f":precondition {text(pre)} :effect {text(effect)})")
    (folder / "domain.pddl").write_text("\n".join([*lines, ")"]))
    (folder / "problem.pddl").write_text(
        f"(define (problem x) (:domain d) (:objects {typed(OBJECTS.items())})\n"
        f"(:init {' '.join(map(text, sorted(state)))}) (:goal {text(goal)}))"
    )
    return read_pddl(folder / "domain.pddl", folder / "problem.pddl")


def of(kind):
    return [name for name, own in OBJECTS.items() if kind in (own, "object")]


def bound(part, values):
    return tuple(values.get(one, one) for one in part)


def true(formula, values, state):
    word = formula[0]
    inside = formula[1:]
    if word in ("forall", "exists"):
        ((variable, kind),) = inside[0]
        found = [true(inside[1], {**values, variable: name}, state) for name in of(kind)]
        return all(found) if word == "forall" else any(found)
    if word == "=":
        first, second = bound(inside, values)
        return first == second
    if word in ARITY:
        return bound(formula, values) in state
    found = [true(part, values, state) for part in inside]
    match word:
        case "not":
            return not found[0]
        case "and":
            return all(found)
        case "or":
            return any(found)
    return found[1] if found[0] else True


def changes(effect, values, state):
    """Yield the fact and its new value for each effect that occurs."""
    match effect[0]:
        case "and":
            for part in effect[1:]:
                yield from changes(part, values, state)
        case "when":
            if true(effect[1], values, state):
                yield from changes(effect[2], values, state)
        case "forall":
            ((variable, kind),) = effect[1]
            for name in of(kind):
                yield from changes(effect[2], {**values, variable: name}, state)
        case "not":
            yield bound(effect[1], values), False
        case _:
            yield bound(effect, values), True


def successors(problem, state):
    for name, parameters, pre, effect in problem[0]:
        for names in itertools.product(*(of(kind) for _, kind in parameters)):
            values = {variable: one for (variable, _), one in zip(parameters, names, strict=True)}
            if true(pre, values, state):
                found = list(changes(effect, values, state))
                added = {fact for fact, value in found if value}
                yield (name, *names), state - {fact for fact, _ in found} | added


def fewest_actions(problem):
    """The number of actions of the shortest plan; None: there is no plan."""
    waiting, known = deque([(problem[1], 0)]), {problem[1]}
    while waiting:
        state, count = waiting.popleft()
        if true(problem[2], {}, state):
            return count
        for _, after in successors(problem, state):
            if after not in known:
                known.add(after)
                waiting.append((after, count + 1))
    return None


def facts(state):
    return frozenset(Fact(name, tuple(arguments)) for name, *arguments in state)


@examples(150)
@given(problem=problems())
def test_a_problem_of_adl_is_solved_where_it_has_a_plan_and_its_plan_is_valid(problem, tmp_path_factory):
    stated, fewest = read(problem, tmp_path_factory.getbasetemp()), fewest_actions(problem)
    try:
        plan = SymbolicPlanner().plan(stated)
    except (GoalError, Unsolvable):
        assert fewest is None
        return
    state = problem[1]
    for action in plan.actions:
        assert not broken_in(stated, action.operator, action.arguments, facts(state))
        after = dict(successors(problem, state))[(action.name, *action.arguments)]
        assert state_after(stated, action.operator, action.arguments, facts(state)) == facts(after)
        state = after
    assert true(problem[2], {}, state)
    assert fewest <= len(plan)


@pytest.mark.slow
@examples(150)
@given(problem=problems())
def test_ground_actions_lead_to_the_states_that_their_formulas_say(problem, tmp_path_factory):
    """So a planner of one's own finds the shortest plan with ``broken_in`` and ``applied_to``."""
    stated = read(problem, tmp_path_factory.getbasetemp())
    try:
        found = ground(stated).actions
    except (GoalError, Unsolvable):
        assert fewest_actions(problem) is None
        return
    waiting, known = [problem[1]], {problem[1]}
    while waiting:
        state = waiting.pop()
        expected = {step: facts(after) for step, after in successors(problem, state)}
        able = [action for action in found if not action.broken_in(facts(state))]
        assert {(one.name, *one.arguments): one.applied_to(facts(state)) for one in able} == expected
        assert (not stated.unmet_in(facts(state))) == true(problem[2], {}, state)
        for _, after in successors(problem, state):
            if after not in known:
                known.add(after)
                waiting.append(after)


@pytest.mark.slow
@examples(100)
@given(problem=problems())
def test_plain_actions_of_a_plan_lead_from_its_states_to_its_states(problem, tmp_path_factory):
    stated = read(problem, tmp_path_factory.getbasetemp())
    try:
        plan = SymbolicPlanner().plan(stated)
    except (GoalError, Unsolvable):
        return
    plain, goal = as_strips(stated, plan)
    everywhere = [facts(state) for state in reachable(problem)]
    state = stated.state
    for action, own in zip(plain.actions, plan.actions, strict=True):
        assert not action.any_of
        assert not action.when
        assert not action.broken_in(state)
        for other in everywhere:
            if not action.broken_in(other):
                assert not own.broken_in(other)
                assert action.applied_to(other) == own.applied_to(other)
        state = action.applied_to(state)
    assert all(literal.holds_in(state) for literal in goal)
    assert all(not stated.unmet_in(one) for one in everywhere if all(literal.holds_in(one) for literal in goal))


def reachable(problem):
    waiting, known = [problem[1]], {problem[1]}
    while waiting:
        for _, after in successors(problem, waiting.pop()):
            if after not in known:
                known.add(after)
                waiting.append(after)
    return known


@pytest.mark.slow
@examples(60)
@given(problem=problems())
def test_a_problem_of_adl_that_is_written_in_pddl_and_read_again_has_the_same_plans(problem, tmp_path_factory):
    folder = tmp_path_factory.getbasetemp()
    stated = read(problem, folder)
    written = PddlText(stated)
    (folder / "again.pddl").write_text(written.domain())
    (folder / "again_problem.pddl").write_text(written.problem())
    again = read_pddl(folder / "again.pddl", folder / "again_problem.pddl")
    try:
        plan = SymbolicPlanner().plan(again)
    except (GoalError, Unsolvable):
        assert fewest_actions(problem) is None
        return
    steps = (written.action(action.name, action.arguments) for action in plan.actions)
    state = stated.state
    for operator, arguments in steps:
        assert not broken_in(stated, operator, arguments, state)
        state = state_after(stated, operator, arguments, state)
    assert not stated.unmet_in(state)


@st.composite
def propositional(draw):
    """A problem without objects, whose formulas are nested and often ask for what nothing reaches."""
    facts = [Fact(f"f{number}") for number in range(6)]
    literals = st.builds(Literal, st.sampled_from(facts), st.booleans())
    nested = st.recursive(
        literals,
        lambda inside: st.builds(Joined, st.booleans(), st.lists(inside, min_size=1, max_size=3).map(tuple)),
        max_leaves=8,
    )
    some = st.lists(st.sampled_from(facts), max_size=2, unique=True).map(tuple)
    operators = [
        Operator(
            f"act{number}",
            pre=tuple(draw(st.lists(literals, max_size=2))),
            add=draw(some),
            delete=draw(some),
            formulas=tuple(draw(st.lists(nested, max_size=1))),
            when=tuple(When(draw(nested), draw(literals)) for _ in range(draw(st.integers(0, 2)))),
        )
        for number in range(draw(st.integers(2, 6)))
    ]
    return PlanningProblem({}, draw(st.frozensets(st.sampled_from(facts))), (draw(nested),), tuple(operators))


@examples(200)
@given(propositional(), st.lists(st.integers(0, 1000), max_size=20))
@pytest.mark.timeout(60)
def test_ground_states_agree_with_facts_along_random_actions(problem, choices):
    try:
        found = ground(problem)
    except (Unsolvable, GoalError):
        return
    state, facts = found.initial, problem.state
    for choice in choices:
        assert (found.goal & ~state == 0) == (not problem.unmet_in(facts))
        applicable = [number for number, needs in enumerate(found.pre) if needs & ~state == 0]
        assert applicable == [number for number, one in enumerate(found.actions) if not one.broken_in(facts)]
        if not applicable:
            return
        action = applicable[choice % len(applicable)]
        state, facts = found.after(state, action), found.actions[action].applied_to(facts)
