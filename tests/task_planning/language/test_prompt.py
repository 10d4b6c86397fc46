from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from bestman_bt.task_planning.language.prompt import goal_messages, plan_messages
from bestman_bt.task_planning.limits import PlanLimits
from bestman_bt.task_planning.symbolic.facts import parse_fact
from bestman_bt.task_planning.symbolic.problem import Fact, PlanningProblem
from tests.task_planning.language.kitchen_problem import INSTRUCTION, OPERATORS, kitchen


def told(problem: PlanningProblem, limits: PlanLimits | None = None) -> dict[str, Any]:
    document: dict[str, Any] = json.loads(plan_messages(problem, limits or PlanLimits())[1].content)
    return document


def test_the_document_has_these_parts_and_no_others() -> None:
    document = told(kitchen())
    assert list(document) == ["abilities", "predicates", "limits", "scene", "not seen", "instruction"]
    assert document["instruction"] == INSTRUCTION
    assert [ability["ability"] for ability in document["abilities"]] == [operator.name for operator in OPERATORS]
    assert set(document["abilities"][0]) == {"ability", "arguments", "pre", "effects", "cost"}
    assert document["scene"]["facts"] == [
        "behind(drawer/board, drawer)",
        "hand_empty",
        "on(can, counter)",
        "on(mug, drawer/board)",
    ]


def test_the_scene_lists_only_what_was_seen() -> None:
    problem = kitchen(spoon="object", fork="object")
    unseen = {Fact("unseen", ("spoon", "table")), Fact("unseen", ("spoon", "counter"))}
    document = told(replace(problem, state=problem.state | unseen))
    assert document["scene"]["names"]["object"] == ["mug", "can"]
    assert "spoon" not in json.dumps(document["scene"])
    assert document["not seen"] == {"spoon": ["counter", "table"], "fork": []}


def test_what_was_seen_once_and_is_lost_stands_where_it_may_be() -> None:
    problem = kitchen()
    state = problem.state - {parse_fact("on(mug, drawer/board)")} | {Fact("unseen", ("mug", "table"))}
    document = told(replace(problem, state=frozenset(state)))
    assert document["not seen"] == {"mug": ["table"]}


def test_only_the_abilities_that_are_allowed_are_reported() -> None:
    limits = PlanLimits(abilities=frozenset({"TuckArm"}), max_cost=9.0, forbidden=frozenset({"can"}))
    document = told(kitchen(), limits)
    assert [ability["ability"] for ability in document["abilities"]] == ["TuckArm"]
    assert document["limits"] == {"steps": 100, "cost": 9.0, "not to be touched": ["can"]}


def test_the_rules_are_the_same_whatever_the_scene_and_the_instruction() -> None:
    other = replace(kitchen(spoon="object"), instruction="tidy up")
    for messages in (plan_messages, goal_messages):
        assert messages(kitchen(), PlanLimits())[0] == messages(other, PlanLimits(max_actions=3))[0]
    assert '"plan"' in plan_messages(other, PlanLimits())[0].content
    assert '"plan"' not in goal_messages(other, PlanLimits())[0].content
