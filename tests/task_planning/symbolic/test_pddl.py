from __future__ import annotations

import re
from importlib.util import find_spec

import pytest

from bestman_bt.task_planning.symbolic.facts import parse_conditions, parse_literals
from bestman_bt.task_planning.symbolic.fast_downward import FastDownwardPlanner, is_valid
from bestman_bt.task_planning.symbolic.grounding import ground
from bestman_bt.task_planning.symbolic.pddl_reading import PddlError, read_pddl
from bestman_bt.task_planning.symbolic.pddl_writing import PddlText
from bestman_bt.task_planning.symbolic.plan_check import broken_in, state_after
from bestman_bt.task_planning.symbolic.problem import (
    Fact,
    Forall,
    Joined,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    Quantified,
    Unsolvable,
    When,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner

needs_fast_downward = pytest.mark.skipif(
    find_spec("up_fast_downward") is None, reason="Fast Downward is GPL: only with the extra planning, never by default"
)

DOMAIN = """(define (domain blocks) ; a comment
  (:requirements :strips :typing :action-costs)
  (:types block - object)
  (:predicates (on ?x ?y - block) (clear ?x - block) (table ?x - block))
  (:functions (total-cost) - number)
  (:action stack
    :parameters (?x ?y - block)
    :precondition (and (clear ?x) (clear ?y) (table ?x) (not (= ?x ?y)))
    :effect (and (on ?x ?y) (not (clear ?y)) (not (table ?x)) (increase (total-cost) 2)))
)
"""
PROBLEM = """(define (problem two)
  (:domain blocks)
  (:objects A b - block)
  (:init (clear a) (clear b) (table a) (table b) (= (total-cost) 0))
  (:goal (and (on a b)))
  (:metric minimize (total-cost)))
"""


@pytest.fixture
def files(tmp_path):
    def write(domain=DOMAIN, problem=PROBLEM):
        (tmp_path / "domain.pddl").write_text(domain)
        (tmp_path / "problem.pddl").write_text(problem)
        return tmp_path / "domain.pddl", tmp_path / "problem.pddl"

    return write


def drawer_problem(goal: str, state: str = "on(cup, chest/drawer); hand_empty") -> PlanningProblem:
    inside = parse_conditions("forall c - container: behind({place}, c) -> open(c)")
    away = parse_conditions("forall p - place: not near(p)")
    assert isinstance(away[0], Forall)
    here = {"object": "object", "place": "place"}
    on, held, empty = Fact("on", ("{object}", "{place}")), Fact("holding", ("{object}",)), Fact("hand_empty")
    near, opened = Fact("near", ("{place}",)), Fact("open", ("{container}",))
    operators = (
        Operator("PickUp", here, (Literal(on), Literal(empty)), inside, (held, near), (on, empty), (away[0],), 3.0),
        Operator("PutAt", here, (Literal(held),), inside, (on, empty, near), (held,), (away[0],), 3.0),
        Operator("Open", {"container": "container"}, (~Literal(opened), Literal(empty)), (), (opened,), cost=4.0),
        Operator("Close", {"container": "container"}, (Literal(opened), Literal(empty)), (), (), (opened,), cost=2.0),
    )
    objects = {"cup": "object", "Table/Top": "place", "chest/drawer": "drawer"}
    facts = frozenset(one.fact for one in parse_literals(state + "; behind(chest/drawer, chest/drawer)"))
    supertypes = {"drawer": ("place", "container")}
    return PlanningProblem(objects, facts, parse_literals(goal), operators, supertypes)


def test_a_problem_is_read_from_pddl_and_solved(files):
    plan = SymbolicPlanner().plan(read_pddl(*files()))
    assert [str(action) for action in plan.actions] == ["stack(a, b)"]
    assert plan.cost == 2.0


def test_names_that_differ_in_case_alone_stay_two_things_in_pddl(tmp_path):
    """As do those that PDDL's letters cannot tell apart."""
    names = ("Mug", "mug", "mug__2", "tea cup", "tea_cup")
    lift = Operator("Lift", {"Thing": "item"}, (Literal(Fact("Low", ("{Thing}",))),), add=(Fact("low", ("{Thing}",)),))
    state = frozenset(Fact("Low", (name,)) for name in names)
    problem = PlanningProblem(dict.fromkeys(names, "item"), state, (Literal(Fact("low", ("mug",))),), (lift,))
    text = PddlText(problem)
    (tmp_path / "d.pddl").write_text(text.domain())
    (tmp_path / "p.pddl").write_text(text.problem())
    again = read_pddl(tmp_path / "d.pddl", tmp_path / "p.pddl")
    assert len(again.objects) == len(again.state) == len(names)
    (action,) = SymbolicPlanner().plan(again).actions
    assert text.action(action.name, action.arguments) == (lift, ("mug",))


def test_what_is_written_is_read_as_the_same_problem(tmp_path):
    problem = drawer_problem("on(cup, Table/Top) and not open(chest/drawer)")
    text = PddlText(problem)
    (tmp_path / "d.pddl").write_text(text.domain())
    (tmp_path / "p.pddl").write_text(text.problem())
    again = SymbolicPlanner().plan(read_pddl(tmp_path / "d.pddl", tmp_path / "p.pddl"))
    names = [text.action(action.name, action.arguments) for action in again.actions]
    assert [(operator.name, arguments) for operator, arguments in names] == [
        ("Open", ("chest/drawer",)),
        ("PickUp", ("cup", "chest/drawer")),
        ("PutAt", ("cup", "Table/Top")),
        ("Close", ("chest/drawer",)),
    ]


def test_things_that_operators_name_are_written_as_constants_and_types_of_quantifiers_are_declared(files):
    red = Literal(Fact("red", ("{box}",)))
    paint = Operator("Paint", {}, (Literal(Fact("wet", ("brush",))),), when=(When(~red, red, {"{box}": "box"}),))
    goal = Quantified(True, "{box}", "box", red)
    objects = {"brush": "tool", "one": "box", "two": "box"}
    problem = PlanningProblem(objects, frozenset({Fact("wet", ("brush",))}), (goal,), (paint,))
    text = PddlText(problem)
    again = read_pddl(*files(text.domain(), text.problem()))
    assert "(:constants\n    brush - tool\n  )" in text.domain()
    assert "brush" not in text.problem().partition("(:init")[0]
    assert len(SymbolicPlanner().plan(again)) == 1


def test_variables_that_are_quantified_together_are_written_together():
    """The reader of unified-planning does not take one ``forall`` in another."""
    near = When(Literal(Fact("calm")), Literal(Fact("near", ("{a}", "{b}"))), {"{a}": "cat", "{b}": "cat"})
    objects = {"tom": "cat", "kim": "cat"}
    goal = (Literal(Fact("near", ("tom", "kim"))),)
    problem = PlanningProblem(objects, frozenset({Fact("calm")}), goal, (Operator("Call", {}, when=(near,)),))
    assert "(forall (?a - cat ?b - cat) (when (calm) (near ?a ?b)))" in PddlText(problem).domain()


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        (
            "(clear ?x) (clear ?y) (table ?x)",
            "(preference p (clear ?x))",
            8,
            "preference is not supported here; 'and', 'or'",
        ),
        ("(on ?x ?y) (not", "(on ?x ?z) (not", 9, "unknown variable '?z'; known: ?x, ?y"),
        ("(increase (total-cost) 2)", "(increase (total-cost) (size ?x))", 9, "NUMBER"),
        (":types", ":durative-action", 3, ":durative-action is not supported"),
        ("(domain blocks)", "(problem blocks)", 1, "(define (domain NAME) …) is expected"),
        ("2)))\n)", "2)))", 1, "'(' is never closed"),
        ("2)))\n)", "2)))\n))", 10, "')' without '('"),
        ("(:types block - object)", "(:types block -)", 3, "a type is expected after '-'"),
        (":typing", ":fluents", 2, ":fluents is not supported"),
        ("(clear ?x) (clear ?y)", "(claer ?x)", 8, "unknown predicate 'claer'; did you mean 'clear'?"),
        ("(clear ?x) (clear ?y)", "(forall (?z - blok) (clear ?z))", 8, "unknown type 'blok'; did you mean 'block'?"),
        ("?x ?y - block)\n", "?x ?y - blok)\n", 7, "unknown type 'blok'"),
        ("(clear ?x) (clear ?y)", "(clear x)", 8, "unknown object 'x'; known: none"),
        ("(clear ?x) (clear ?y)", "(exists (z - block) (clear ?z))", 8, "a variable starts with '?', as ?z"),
        ("?x ?y - block)\n", "?x ?x - block)\n", 7, "?x is declared twice"),
        ("(= ?x ?y)", "(= ?x)", 8, "= takes 2 things, not 1"),
        ("(= ?x ?y)", "(= ?x ?y ?y)", 8, "= takes 2 things, not 3"),
        ("2)))\n", "2))\n:effect (clear ?x))\n", 10, "stack has two :effect"),
        ("2)))\n", "2)))\n(:action stack)\n", 10, "there are two actions stack"),
    ],
)
def test_a_malformed_domain_is_reported_with_file_and_line(files, old, new, line, words):
    assert old in DOMAIN
    with pytest.raises(PddlError) as raised:
        read_pddl(*files(DOMAIN.replace(old, new)))
    assert raised.value.line == line
    assert words in str(raised.value)
    assert "domain.pddl" in raised.value.file


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ("(clear b)", "(claer b)", 4, "unknown predicate 'claer'; did you mean 'clear'?"),
        ("(clear b)", "(clear a b)", 4, "clear takes 1 things, not 2"),
        ("(and (on a b))", "(not (on a bb))", 5, "unknown object 'bb'; did you mean 'b'?"),
        ("(and (on a b))", "(on ?x b)", 5, "unknown variable '?x'; known: none"),
        ("A b - block", "a b - blok", 3, "unknown type 'blok'; did you mean 'block'?"),
        ("A b - block", "a b - block b - object", 3, "b is declared as block and as object"),
        ("(and (on a b))", "(onn a b)", 5, "unknown predicate 'onn'; did you mean 'on'?"),
        ("(clear b)", "(not (clear a))", 4, "clear(a) and not clear(a) cannot hold together"),
        ("(and (on a b))", "(imply (on a b))", 5, "imply takes two conditions"),
        ("A b - block", "a b - (either block ball)", 3, "either is not supported; one type is"),
        ("(:goal (and (on a b)))", "", 1, "there is no (:goal …)"),
        ("(:domain blocks)", "(:domain blocks) (:requirements :timed-initial-literals)", 2, "is not supported"),
        (PROBLEM, "", 1, "one (define …) is expected, not 0"),
    ],
)
def test_what_makes_no_sense_in_a_problem_is_reported_with_file_and_line(files, old, new, line, words):
    assert old in PROBLEM
    with pytest.raises(PddlError) as raised:
        read_pddl(*files(problem=PROBLEM.replace(old, new)))
    assert raised.value.line == line
    assert words in str(raised.value)


def test_a_malformed_problem_is_reported_with_file_and_line(files):
    with pytest.raises(PddlError, match=r"problem\.pddl:5: forall takes variables and a condition"):
        read_pddl(*files(problem=PROBLEM.replace("(and (on a b))", "(forall (on a b))")))


def test_a_file_that_is_not_there_is_reported(tmp_path):
    with pytest.raises(PddlError, match="cannot be read"):
        read_pddl(tmp_path / "none.pddl", tmp_path / "none.pddl")


@needs_fast_downward
def test_fast_downward_solves_it_and_the_validator_agrees_with_both_planners():
    problem = drawer_problem("on(cup, Table/Top) and not open(chest/drawer)")
    theirs, ours = FastDownwardPlanner().plan(problem), SymbolicPlanner().plan(problem)
    assert [str(action) for action in theirs.actions] == [str(action) for action in ours.actions]
    assert is_valid(problem, theirs)


@needs_fast_downward
def test_fast_downward_reports_that_there_is_no_plan():
    with pytest.raises(Unsolvable):
        FastDownwardPlanner().plan(drawer_problem("on(cup, Table/Top)", "open(chest/drawer); hand_empty"))


@needs_fast_downward
def test_an_error_of_unified_planning_says_which_planner_does_without_it():
    with pytest.raises(PlanningError, match=r"warp of unified-planning raised .*; SymbolicPlanner\(hand_over=0\)"):
        FastDownwardPlanner(engine="warp").plan(drawer_problem("on(cup, Table/Top)"))


def test_a_goal_that_holds_needs_no_engine():
    assert len(FastDownwardPlanner().plan(drawer_problem("hand_empty"))) == 0


@pytest.mark.slow
def test_the_validator_needs_no_engine_and_finds_the_missing_step():
    problem = drawer_problem("on(cup, Table/Top) and not open(chest/drawer)")
    plan = SymbolicPlanner().plan(problem)
    assert is_valid(problem, plan)
    assert not is_valid(problem, type(plan)(plan.actions[1:]))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (":effect (and", ":duration (= ?d 3) :effect (and", ":duration is not supported"),
        ("(on ?x ?y) (not (clear ?y))", "(when (clear ?x))", "when takes a condition and an effect"),
        (
            "(on ?x ?y) (not (clear ?y))",
            "(or (clear ?x) (table ?x))",
            "or is not supported here; 'and', 'not', 'forall'",
        ),
        ("(on ?x ?y) (not (clear ?y))", "(not (and (clear ?x)))", "and is not supported here"),
        ("(on ?x ?y)", "(when (clear ?x) (increase (total-cost) 1))", "NUMBER) outside of these"),
        ("(on ?x ?y) (not (clear ?y))", "(imply (clear ?x) (table ?x))", "imply is not supported here"),
        ("(not (= ?x ?y))", "(when (clear ?x) (clear ?y))", "when is not supported here; 'and', 'or', 'not', 'imply'"),
        ("(not (= ?x ?y))", "(exists () (clear ?x))", "exists takes at least one variable"),
        ("(not (= ?x ?y))", "(exists (?z - block) (clear ?w))", "unknown variable '?w'; known: ?x, ?y, ?z"),
        ("(not (= ?x ?y))", "(not (clear ?x) (clear ?y))", "takes one condition"),
        ("(not (= ?x ?y))", "clear", "'(' is expected, not 'clear'"),
        ("(not (= ?x ?y))", "(clear (on ?x))", "a name is expected, not '('"),
        ("(increase (total-cost) 2)", "(increase (total-cost) ?x)", "increase"),
    ],
)
def test_what_is_not_supported_is_reported_and_not_left_out(files, old, new, words):
    assert old in DOMAIN
    with pytest.raises(PddlError) as raised:
        read_pddl(*files(DOMAIN.replace(old, new)))
    assert words in str(raised.value)
    assert raised.value.line in (7, 8, 9, 10)


def test_constants_effects_on_each_and_conditions_without_a_type_are_read(files):
    domain = DOMAIN.replace("(:functions", "(:constants floor - block)\n  (:functions")
    domain = domain.replace("(not (table ?x))", "(not (table ?x)) (forall (?z - block) (not (on ?z ?x)))")
    problem = read_pddl(*files(domain))
    assert problem.objects == {"a": "block", "b": "block", "floor": "block"}
    (stack,) = problem.operators
    assert stack.when == (When(Joined(True, ()), Literal(Fact("on", ("{z}", "{x}")), True), {"{z}": "block"}),)
    assert (stack.cost, stack.parameters) == (2.0, {"x": "block", "y": "block"})


def test_costs_count_as_the_metric_says(files):
    free, shortest = (
        DOMAIN.replace(" (increase (total-cost) 2)", ""),
        PROBLEM.replace("(:metric minimize (total-cost))", ""),
    )
    assert read_pddl(*files(free)).operators[0].cost == 0.0
    assert read_pddl(*files(DOMAIN.replace("(total-cost) 2", "(total-cost) 0"))).operators[0].cost == 0.0
    assert read_pddl(*files(DOMAIN, shortest)).operators[0].cost == 1.0
    for old, new, line in (("(total-cost) 2", "(fuel) 2", 9), ("minimize", "maximize", 6)):
        with pytest.raises(PddlError, match="is the only supported form") as raised:
            read_pddl(*files(DOMAIN.replace(old, new), PROBLEM.replace(old, new)))
        assert raised.value.line == line


def test_a_condition_that_depends_on_equality_is_not_dropped(files):
    domain = DOMAIN.replace("(not (= ?x ?y))", "(forall (?z - block) (imply (= ?z ?y) (on ?z ?x)))")
    with pytest.raises(Unsolvable):
        SymbolicPlanner().plan(read_pddl(*files(domain)))


def test_a_variable_of_forall_hides_the_parameter_of_its_name(files):
    domain = DOMAIN.replace("(not (= ?x ?y))", "(forall (?x - block) (not (on ?x ?y)))")
    (stack,) = read_pddl(*files(domain)).operators
    problem = read_pddl(*files(domain, PROBLEM.replace("(clear a)", "(clear a) (on b b)")))
    assert "{x}" not in str(stack.formulas[0]).partition(":")[2]
    with pytest.raises(Unsolvable):
        SymbolicPlanner().plan(problem)


NESTED = """(define (domain nested) (:requirements :adl)
  (:types thing empty)
  (:predicates (small ?x) (marked ?x))
  (:action mark :parameters (?x - thing) :precondition () :effect {effect}))
"""


@pytest.mark.parametrize(
    ("effect", "marked"),
    [
        ("(forall (?x - thing) (forall (?x - thing) (marked ?x)))", "ab"),
        ("(forall (?x - empty) (forall (?x - thing) (forall (?x - thing) (marked ?x))))", ""),
        ("(when (small ?x) (forall (?x - thing) (forall (?x - thing) (marked ?x))))", "ab"),
        ("(forall (?x - thing) (when (small ?x) (forall (?x - thing) (forall (?x - thing) (marked ?x)))))", "ab"),
        ("(forall (?y - empty) (forall (?y ?y_ - thing) (forall (?y_ - thing) (marked ?y_))))", ""),
    ],
)
def test_a_variable_does_not_get_the_name_of_one_that_is_hidden(files, effect, marked):
    problem = "(define (problem x) (:domain nested) (:objects a b - thing) (:init (small a)) (:goal (marked b)))"
    stated = read_pddl(*files(NESTED.format(effect=effect), problem))
    after = state_after(stated, stated.operators[0], ["a"], stated.state) - stated.state
    assert after == {Fact("marked", (name,)) for name in marked}


def test_a_predicate_takes_as_many_things_as_variables_stand_in_its_declaration(files):
    domain = DOMAIN.replace("(on ?x ?y - block)", "(on ?x ?x - block)")
    assert read_pddl(*files(domain)).predicates["on"] == ("block", "block")


def test_types_and_constants_may_be_declared_after_what_uses_them(files):
    types = "(:types block - object)"
    domain = DOMAIN.replace(types, "").replace("2)))\n", f"2)))\n(:constants floor - block) {types}\n")
    assert read_pddl(*files(domain)).objects == {"a": "block", "b": "block", "floor": "block"}


def test_a_type_that_is_named_after_a_dash_alone_is_an_object(files):
    domain = DOMAIN.replace("block - object", "block - piece").replace("?x ?y - block", "?x ?y - object")
    assert len(SymbolicPlanner().plan(read_pddl(*files(domain)))) == 1


def test_a_goal_that_asks_for_nothing_holds_already(files):
    assert len(SymbolicPlanner().plan(read_pddl(*files(problem=PROBLEM.replace("(and (on a b))", "(and)"))))) == 0


GRIPPERS = """(define (domain grippers)
  (:requirements :adl)
  (:types ball gripper room)
  (:predicates (at ?x - object ?r - room) (robot ?r - room) (holds ?g - gripper ?b - ball) (lit ?r - room))
  (:action light :parameters (?r - room) :precondition (robot ?r) :effect (lit ?r))
  (:action pick
    :parameters (?b - ball ?g - gripper)
    :precondition (and (exists (?r - room) (and (robot ?r) (at ?b ?r) (lit ?r)))
      (not (exists (?o - ball) (holds ?g ?o))))
    :effect (holds ?g ?b))
  (:action move
    :parameters (?from ?to - room)
    :precondition (robot ?from)
    :effect (and (not (robot ?from)) (robot ?to)
      (forall (?b - ball) (when (exists (?g - gripper) (holds ?g ?b)) (and (at ?b ?to) (not (at ?b ?from)))))))
)
"""
BALLS = """(define (problem balls) (:domain grippers)
  (:objects one two - ball left right - gripper start end - room)
  (:init (at one start) (at two start) (robot start))
  (:goal (and (forall (?b - ball) (at ?b end)) (or (lit end) (robot start)))))
"""


@pytest.mark.parametrize("planner", [SymbolicPlanner(), pytest.param(FastDownwardPlanner(), marks=needs_fast_downward)])
def test_conditional_effects_and_formulas_are_planned_with(files, planner):
    """What is held moves with the robot, which lights the room where it takes balls and one of two at the end."""
    problem = read_pddl(*files(GRIPPERS, BALLS))
    plan = planner.plan(problem)
    assert planner != SymbolicPlanner() or len(plan) == 5
    state = problem.state
    for action in plan.actions:
        assert not broken_in(problem, action.operator, action.arguments, state)
        state = state_after(problem, action.operator, action.arguments, state)
    assert not problem.unmet_in(state)


LIGHTS = """(define (domain lights)
  (:requirements :adl)
  (:types lamp)
  (:constants red blue green white - lamp)
  (:predicates (lit ?l - lamp) (broken ?l - lamp) (done))
  (:action light :parameters (?l - lamp) :precondition (not (broken ?l)) :effect (lit ?l))
  (:action put-out :parameters (?l - lamp) :precondition (lit ?l) :effect (not (lit ?l)))
  (:action finish
    :precondition (or (lit red) (and (lit blue) (or (lit green) (lit white))))
    :effect (done))
)
"""
LAMPS = """(define (problem lamps) (:domain lights)
  (:init (broken red) (lit blue))
  (:goal (and (done) (not (or (lit blue) (and (lit green) (or (lit red) (lit white))))))))
"""


def test_a_disjunction_within_another_follows_each_change(files):
    problem = read_pddl(*files(LIGHTS, LAMPS))
    plan = SymbolicPlanner().plan(problem)
    assert [action.name for action in plan.actions] == ["light", "finish", "put-out"]
    ground_problem = ground(problem)
    state = ground_problem.initial
    for name in ("light(green)", "finish()", "put-out(green)", "light(white)", "put-out(blue)"):
        (number,) = (n for n, action in enumerate(ground_problem.actions) if str(action) == name)
        assert ground_problem.pre[number] & ~state == 0, name
        state = ground_problem.after(state, number)
    (finish,) = (n for n, action in enumerate(ground_problem.actions) if str(action) == "finish()")
    assert ground_problem.pre[finish] & ~state


def test_the_reason_for_an_unreachable_goal_of_formulas_is_reported(files):
    problem = read_pddl(*files(GRIPPERS, BALLS.replace("(robot start))\n", ")\n")))
    with pytest.raises(Unsolvable, match=re.escape("(forall b - ball: at(b, end)) and (lit(end) or robot(start))")):
        SymbolicPlanner().plan(problem)


def test_types_in_a_circle_and_brackets_without_end_are_refused(files):
    with pytest.raises(PddlError, match="the types form a cycle: a - b - a"):
        read_pddl(*files(DOMAIN.replace("block - object", "a - b b - a block - object")))
    deep = DOMAIN.replace("(clear ?x) (clear ?y)", "(and " * 3000 + "(clear ?x)" + ")" * 3000)
    with pytest.raises(PddlError, match="nested brackets") as raised:
        read_pddl(*files(deep))
    assert raised.value.line == 8
