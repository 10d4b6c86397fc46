from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.facts.located import UNSEEN
from bestman_bt.registry import PLANNERS, UnknownNameError
from bestman_bt.task_planning.language.errors import EndpointNotSetError, ModelRefusedError, NoValidAnswerError
from bestman_bt.task_planning.language.from_text import checked_goal, plan_from_text
from bestman_bt.task_planning.language.schema import GoalAnswer
from bestman_bt.task_planning.limits import LimitsExceededError, PlanLimits, plan_within
from bestman_bt.task_planning.symbolic.facts import parse_fact, parse_literals
from bestman_bt.task_planning.symbolic.problem import Unsolvable
from tests.answering_server import Server, Way
from tests.task_planning.language.kitchen_problem import GOAL, INSTRUCTION, RIGHT, kitchen
from tests.task_planning.language.misbehaving_server import says, serving

PLAN = "OpenContainer(drawer)\nPickUp(mug, drawer/board)\nPutDown(mug, table)"


def reads(goal: list[str], refusal: str | None = None) -> Way:
    return says({"refusal": refusal, "goal": goal})


@pytest.fixture
def ask(monkeypatch: pytest.MonkeyPatch) -> Callable[[Server], None]:
    def at(server: Server) -> None:
        monkeypatch.setenv("BESTMAN_LLM_BASE_URL", server.base_url)
        monkeypatch.setenv("BESTMAN_LLM_MODEL", "small")

    return at


def test_the_models_own_steps(ask: Callable[[Server], None]) -> None:
    with serving(says(RIGHT)) as server:
        ask(server)
        proposal = plan_from_text(INSTRUCTION, kitchen())
    assert str(proposal.plan) == PLAN


def test_the_models_goal_and_the_symbolic_planners_steps(ask: Callable[[Server], None]) -> None:
    with serving(reads(["on(mgu, table)"]), reads(GOAL)) as server:
        ask(server)
        proposal = plan_from_text(INSTRUCTION, kitchen(), "symbolic")
    assert str(proposal.plan) == PLAN
    assert [str(literal) for literal in proposal.problem.goal] == GOAL
    assert proposal.usage.questions == 2
    assert "plan" not in server.questions[0]["response_format"]["json_schema"]["schema"]["properties"]


def test_a_goal_out_of_reach_is_reported_by_the_planner(ask: Callable[[Server], None]) -> None:
    with serving(reads(["on(can, table) and not on(can, counter) and behind(table, fridge)"])) as server:
        ask(server)
        with pytest.raises(Unsolvable, match=r"behind\(table, fridge\)"):
            plan_from_text(INSTRUCTION, kitchen(), "symbolic")


def test_a_goal_given_as_facts_is_planned_for_by_the_model(ask: Callable[[Server], None]) -> None:
    with serving(says(RIGHT)) as server:
        ask(server)
        proposal = plan_from_text("", replace(kitchen(), instruction="", goal=parse_literals("on(mug, table)")))
    assert str(proposal.plan) == PLAN


def test_by_its_name_in_the_registry_it_plans_within_limits_too(ask: Callable[[Server], None]) -> None:
    problem = replace(kitchen(spoon="object"), instruction="", goal=parse_literals("on(mug, table)"))
    with serving(says(RIGHT)) as server:
        ask(server)
        planner = PLANNERS.resolve("language")()
        assert str(plan_within(planner, problem, PlanLimits.from_string("without=fridge"))) == PLAN
        assert '"not seen": {"spoon": []}' in server.questions[0]["messages"][1]["content"]
        with pytest.raises(NoValidAnswerError, match=r"it needs allowed\(drawer\)"):
            plan_within(planner, problem, PlanLimits.from_string("without=drawer"))


def test_limits_hold_for_the_symbolic_planners_steps(ask: Callable[[Server], None]) -> None:
    with serving(reads(GOAL)) as server:
        ask(server)
        with pytest.raises(Unsolvable):
            plan_from_text(INSTRUCTION, kitchen(), "symbolic", limits=PlanLimits(forbidden=frozenset({"drawer"})))
        with pytest.raises(LimitsExceededError, match="3 steps; at most 2 are allowed"):
            plan_from_text(INSTRUCTION, kitchen(), "symbolic", limits=PlanLimits(max_actions=2))
        proposal = plan_from_text(
            INSTRUCTION, kitchen(), "symbolic", limits=PlanLimits(forbidden=frozenset({"fridge"}))
        )
    assert str(proposal.plan) == PLAN
    assert all("allowed" not in str(need) for action in proposal.plan.actions for need in action.pre)


def test_a_refusal_and_a_model_that_finds_no_goal_end_without_a_plan(ask: Callable[[Server], None]) -> None:
    with serving(reads([], "There is no mug in sight.")) as server:
        ask(server)
        with pytest.raises(ModelRefusedError, match="There is no mug in sight"):
            plan_from_text(INSTRUCTION, kitchen(), "symbolic")
    with serving(reads([])) as server:
        ask(server)
        with pytest.raises(NoValidAnswerError, match="goal: empty"):
            plan_from_text(INSTRUCTION, kitchen(), "symbolic")


@pytest.mark.parametrize("planner", ["language", "symbolic"])
def test_a_transcript_is_written_and_takes_the_place_of_the_endpoint(
    ask: Callable[[Server], None], planner: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "talk.jsonl"
    with serving(says(RIGHT) if planner == "language" else reads(GOAL)) as server:
        ask(server)
        recorded = plan_from_text(INSTRUCTION, kitchen(), planner, record=path)
    monkeypatch.delenv("BESTMAN_LLM_BASE_URL")
    assert plan_from_text(INSTRUCTION, kitchen(), planner, replay=path) == recorded


def test_without_an_endpoint_the_missing_variables_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("BESTMAN_LLM_BASE_URL", raising=False)
    monkeypatch.delenv("BESTMAN_LLM_MODEL", raising=False)
    with pytest.raises(EndpointNotSetError, match="set BESTMAN_LLM_BASE_URL and BESTMAN_LLM_MODEL in the environment"):
        plan_from_text(INSTRUCTION, kitchen())


def test_an_unknown_planner_is_reported_with_the_closest() -> None:
    with pytest.raises(UnknownNameError, match="did you mean 'language'"):
        plan_from_text(INSTRUCTION, kitchen(), "langauge")


@pytest.mark.parametrize(
    ("told", "left"),
    [
        ([], {"mug, counter", "mug, table", "can, counter", "can, table"}),
        (["on(mug, table)"], {"mug, table", "can, counter", "can, table"}),
        (["on(mug, table)", "on(can, table)"], {"mug, table", "can, table"}),
        (["on(mug, drawer/board)"], {"mug, counter", "mug, table", "can, counter", "can, table"}),  # was searched
    ],
)
def test_the_place_of_one_thing_says_nothing_of_the_others(told: list[str], left: set[str]) -> None:
    unseen = {
        parse_fact(f"{UNSEEN.name}({thing}, {place})") for thing in ("mug", "can") for place in ("counter", "table")
    }
    problem = kitchen()
    problem = replace(
        problem,
        state=problem.state | unseen,
        predicates={**problem.predicates, UNSEEN.name: ("object", "place")},
    )
    state = checked_goal(problem, GoalAnswer(goal=GOAL, given_places=told)).state
    assert {", ".join(fact.arguments) for fact in state & unseen} == left
    assert state - unseen == problem.state - unseen
