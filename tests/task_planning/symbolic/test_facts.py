from __future__ import annotations

import pytest

from bestman_bt.task_planning.symbolic.facts import (
    FactSyntaxError,
    goal_as_facts,
    parse_conditions,
    parse_fact,
    parse_literals,
)
from bestman_bt.task_planning.symbolic.problem import Fact, Forall, GoalError, Literal


def test_a_goal_is_facts_joined_by_and():
    assert parse_literals("on(mug, table/top) and not open(drawer_chest/drawer_3)") == (
        Literal(Fact("on", ("mug", "table/top"))),
        Literal(Fact("open", ("drawer_chest/drawer_3",)), negated=True),
    )


def test_declarations_separate_facts_by_semicolons_and_name_parameters_in_braces():
    assert parse_literals("on({object},{place}); hand_empty;") == (
        Literal(Fact("on", ("{object}", "{place}"))),
        Literal(Fact("hand_empty")),
    )


def test_names_may_have_hyphens_and_dots():
    assert parse_fact("on(mug-2, shelf.a)") == Fact("on", ("mug-2", "shelf.a"))


def test_parentheses_and_double_negation_are_understood():
    for text, negated in (("not (not hand_empty)", False), ("not not hand_empty", False), ("not not not open", True)):
        assert parse_literals(text) == (Literal(Fact(text.split()[-1].strip("()")), negated),)


def test_forall_binds_its_variable():
    (condition,) = parse_conditions("forall c - container: behind({place}, c) -> open(c)")
    assert condition == Forall("{c}", "container", Fact("behind", ("{place}", "{c}")), Literal(Fact("open", ("{c}",))))
    assert str(condition) == "forall c - container: behind({place}, c) -> open(c)"


def test_what_is_printed_parses_again():
    text = "on(mug, table) and not open(drawer) and hand_empty"
    assert " and ".join(map(str, parse_literals(text))) == text


@pytest.mark.parametrize(
    ("text", "column", "words"),
    [
        ("on(mug table)", 8, "',' is expected, not 'table'"),
        ("on(mug, table", 14, "not the end"),
        ("on(mug) open(x)", 9, "'and' is expected"),
        ("on(mug) & open(x)", 9, "'&' is not part of a fact"),
        ("and on(mug)", 1, "a fact is expected"),
        ("not", 4, "a fact is expected"),
        ("hand_empty and", 15, "a fact is expected after 'and'"),
        ("(" * 2000 + "x" + ")" * 2000, 52, "nested brackets"),
        ("on(not, table)", 4, "a name is expected"),
    ],
)
def test_what_is_no_fact_is_reported_with_its_column(text, column, words):
    with pytest.raises(FactSyntaxError, match=f"column {column} ") as raised:
        parse_literals(text)
    assert words in str(raised.value)
    assert raised.value.column == column


def test_forall_may_come_without_a_condition():
    (effect,) = parse_conditions("forall p - place: not near(p)")
    assert effect == Forall("{p}", "place", None, Literal(Fact("near", ("{p}",)), negated=True))
    assert str(effect) == "forall p - place: not near(p)"


def test_goals_know_no_forall():
    with pytest.raises(FactSyntaxError, match="forall"):
        parse_literals("forall c - container: behind(x, c) -> open(c)")


@pytest.mark.parametrize("text", ["on(mug, table) and open(x)", "not open(x)"])
def test_where_one_fact_is_asked_for_neither_several_nor_a_negation_is_one(text):
    with pytest.raises(FactSyntaxError, match="one fact is expected"):
        parse_fact(text)


def test_what_a_forall_asks_for_is_not_negated():
    with pytest.raises(FactSyntaxError, match="a fact that is not negated is expected before '->'"):
        parse_conditions("forall c - container: not behind(x, c) -> open(c)")
    (condition,) = parse_conditions("forall c - container: behind(x, c) -> not open(c)")
    assert condition.then == Literal(Fact("open", ("{c}",)), negated=True)


@pytest.mark.parametrize(
    ("goal", "facts"),
    [
        ("(on cup counter)", "on(cup, counter)"),
        ("(and (on cup shelf__board_1) (not (open fridge)) (hand_empty))",
         "on(cup, shelf/board_1) and not open(fridge) and hand_empty"),
        ("(not on(cup, table))", "not on(cup, table)"),
        ("on(cup, table); closed(drawer)", "on(cup, table) and closed(drawer)"),
    ],
)  # fmt: skip
def test_goals_in_pddl_are_understood_beside_facts(goal: str, facts: str) -> None:
    assert goal_as_facts(goal) == facts


@pytest.mark.parametrize(
    ("goal", "words"),
    [
        ("on cup counter", r"column 4 .* a goal is written as on\(mug, table\)"),
        (
            "(or (on cup table) (on cup counter))",
            "or is not supported in a goal for abilities; facts, 'not' before one, and 'and' are",
        ),
        ("(not (and (on cup table)(hand_empty)))", r"not \(and …\) is not supported in a goal for abilities"),
        ("(and (hand_empty) (not (= cup table)))", r"not \(= …\) is not supported in a goal for abilities"),
        ("(on cup (counter))", "a name is expected"),
        ("none.pddl", "none.pddl:1: it cannot be read"),
    ],
)
def test_a_goal_that_cannot_be_read_is_answered_with_the_form(goal: str, words: str) -> None:
    with pytest.raises(GoalError, match=words):
        goal_as_facts(goal)
