from __future__ import annotations

from dataclasses import replace

import pytest

from bestman_bt.engine import SUCCESS, NodeRegistry
from bestman_bt.task_planning.builders.backchain import BackchainBuilder
from bestman_bt.task_planning.builders.reactive import ReactiveBuilder
from bestman_bt.task_planning.builders.sequence import SequenceBuilder
from bestman_bt.task_planning.simulation import SymbolicWorld, dry_run
from bestman_bt.task_planning.symbolic.problem import (
    EQUAL,
    Fact,
    Joined,
    Literal,
    Operator,
    PlanningError,
    PlanningProblem,
    Quantified,
    TaskPlan,
    When,
)
from bestman_bt.task_planning.symbolic.search import SymbolicPlanner
from bestman_bt.task_planning.symbolic.strips_plan import as_strips

LIT = Literal(Fact("lit", ("{lamp}",)))
READ = Literal(Fact("read", ("book",)))
OPERATORS = (
    Operator("Press", {"lamp": "lamp"}, when=(When(LIT, ~LIT), When(~LIT, LIT))),
    Operator("Read", {}, formulas=(Quantified(False, "{lamp}", "lamp", LIT),), add=(READ.fact,)),
)
PROBLEM = PlanningProblem(
    {"desk": "lamp", "floor": "lamp", "book": "book"},
    frozenset(),
    (READ, Quantified(True, "{lamp}", "lamp", ~LIT)),
    OPERATORS,
)
"""The same switch turns a lamp on and off; who reads needs one of the lamps, and none stays on."""


def test_a_plan_of_plain_actions_says_why_its_effects_occur():
    plan, goal = as_strips(PROBLEM, SymbolicPlanner().plan(PROBLEM))
    on, read, off = plan.actions
    desk = Fact("lit", on.arguments)
    assert [action.name for action in plan.actions] == ["Press", "Read", "Press"]
    assert (on.pre, on.add, on.delete) == ({Literal(desk, True)}, {desk}, set())
    assert read.pre == {Literal(desk)}
    assert (off.pre, off.add, off.delete) == ({Literal(desk)}, set(), {desk})
    assert goal == (READ, Literal(Fact("lit", ("desk",)), True), Literal(Fact("lit", ("floor",)), True))


@pytest.mark.parametrize("builder", [SequenceBuilder(), ReactiveBuilder(), BackchainBuilder()])
def test_the_tree_of_plain_actions_reaches_the_goal(builder):
    made = builder.build(*as_strips(PROBLEM, SymbolicPlanner().plan(PROBLEM)))
    run = dry_run(made.document().to_xml(), SymbolicWorld(PROBLEM), NodeRegistry())
    assert (run.status, run.reached) == (SUCCESS, True)
    assert len(run.done) == 3


@pytest.mark.parametrize("builder", [SequenceBuilder(), ReactiveBuilder(), BackchainBuilder()])
def test_a_tree_does_not_ask_for_equality_that_the_goal_states(builder):
    differ = Literal(Fact(EQUAL, ("desk", "floor")), negated=True)
    problem = replace(PROBLEM, goal=(READ, differ))
    made = builder.build(*as_strips(problem, SymbolicPlanner().plan(problem)))
    run = dry_run(made.document().to_xml(), SymbolicWorld(problem), NodeRegistry())
    assert (run.status, run.reached) == (SUCCESS, True)


@pytest.mark.parametrize("builder", [SequenceBuilder(), ReactiveBuilder(), BackchainBuilder()])
def test_a_tree_of_conditional_effects_or_of_formulas_is_refused(builder):
    plan = SymbolicPlanner().plan(PROBLEM)
    with pytest.raises(PlanningError, match=r"Press\((desk|floor)\) has formulas or conditional effects; .* as_strips"):
        builder.build(plan, [READ])
    with pytest.raises(PlanningError, match=r"forall lamp - lamp: not lit\(lamp\)\) has formulas"):
        builder.build(as_strips(PROBLEM, plan)[0], PROBLEM.goal)


def test_a_plan_that_cannot_be_carried_out_has_no_plain_actions():
    press, read, _ = SymbolicPlanner().plan(PROBLEM).actions
    with pytest.raises(PlanningError, match=r"Read\(\): it needs \(lit\(desk\) or lit\(floor\)\)"):
        as_strips(PROBLEM, TaskPlan((read, press)))
    with pytest.raises(PlanningError, match=r"after the plan \(forall lamp - lamp: not lit\(lamp\)\) does not hold"):
        as_strips(PROBLEM, TaskPlan((press, read)))


def test_an_action_whose_condition_never_holds_is_not_part_of_a_plan():
    never = Operator("Never", {}, formulas=(Joined(False, ()),), add=(READ.fact,))
    problem = PlanningProblem({"book": "book"}, frozenset(), (READ,), (never,))
    with pytest.raises(PlanningError, match="no action achieves that read"):
        SymbolicPlanner().plan(problem)


def test_a_formula_that_nothing_makes_true_is_shown_as_false():
    nothing = PlanningProblem({"desk": "lamp"}, frozenset(), (Joined(False, ()),), OPERATORS)
    with pytest.raises(PlanningError, match=r"no action achieves that \(false\)"):
        SymbolicPlanner().plan(nothing)
    assert str(Joined(True, ())) == "(true)"


def test_a_plain_action_asks_for_what_keeps_a_conditional_effect_from_occurring():
    dark = Literal(Fact("lit", ("desk",)), negated=True)
    read = Operator("Read", {}, add=(READ.fact,), when=(When(~dark, ~READ), When(~dark, Literal(Fact("seen")))))
    problem = PlanningProblem({"desk": "lamp", "book": "book"}, frozenset(), (READ,), (OPERATORS[0], read))
    (action,) = as_strips(problem, SymbolicPlanner().plan(problem))[0].actions
    assert (action.pre, action.add) == ({dark}, {READ.fact})


def test_what_an_action_adds_holds_though_a_conditional_effect_takes_it_away():
    read = Operator("Read", {}, add=(READ.fact,), when=(When(Literal(Fact("lit", ("desk",))), ~READ),))
    state = frozenset({Fact("lit", ("desk",))})
    problem = PlanningProblem({"desk": "lamp", "book": "book"}, state, (READ,), (OPERATORS[0], read))
    assert [action.name for action in SymbolicPlanner().plan(problem).actions] == ["Read"]
