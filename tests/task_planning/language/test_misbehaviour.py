from __future__ import annotations

import json
from dataclasses import replace

import pytest

from bestman_bt.task_planning.language.endpoint import EndpointAddress, EndpointLimits, HttpEndpoint
from bestman_bt.task_planning.language.errors import (
    EndpointUnreachableError,
    LanguageError,
    ModelRefusedError,
    NoValidAnswerError,
)
from bestman_bt.task_planning.language.from_text import LanguagePlanner, Proposal
from bestman_bt.task_planning.symbolic.facts import parse_literals
from bestman_bt.task_planning.symbolic.problem import PlanningError
from tests.answering_server import Server, Way, breaks_off, sleeps
from tests.task_planning.language.kitchen_problem import FETCH, RIGHT, answer, kitchen, step
from tests.task_planning.language.misbehaving_server import (
    calls_a_tool,
    completion,
    fails,
    refuses,
    says,
    serving,
    stops_at_length,
)

TUCK, UNTIL_TABLE = step("TuckArm"), "on(mug, table)"
AND_BACK = [step("PickUp", object="mug", place="table"), step("PutDown", object="mug", place="table")]

ANSWERS: dict[str, tuple[Way, str]] = {
    "prose": (says("Sure! First I open the drawer, then I take the mug."), "Invalid JSON"),
    "wrong JSON": (says('{"refusal": null, "goal": ["on(mug, table)"], "plan": [{"ability": '), "Invalid JSON"),
    "deep JSON": (says("[" * 100_000), "recursion limit"),
    "other JSON": (says({"steps": ["open", "pick"]}), "goal: Field required"),
    "unknown skill": (
        says(answer([*FETCH, step("OpenFridgeWithForce", container="fridge")])),
        "there is no ability 'OpenFridgeWithForce'",
    ),
    "unknown object": (
        says(answer([FETCH[0], step("PickUp", object="mugg", place="drawer/board"), FETCH[2]])),
        "'mugg' is not known here; did you mean 'mug'",
    ),
    "wrong type": (says(answer([step("OpenContainer", container="mug")])), "'mug' is not known here"),
    "no argument": (says(answer([step("OpenContainer")])), "container: Field required"),
    "cyclic plan": (
        says(answer([*FETCH, *AND_BACK])),
        "step 4, .*: all is then as after step 2, PickUp",
    ),
    "empty plan": (says(answer([])), "the plan is empty, and the goal's on\\(mug, table\\) does not hold"),
    "no goal": (says(answer(FETCH, goal=[])), "goal: empty"),
    "goal of an unknown thing": (
        says(answer(FETCH, goal=["on(mgu, table)"])),
        "unknown object 'mgu'; did you mean",
    ),
    "goal of an unknown kind": (
        says(answer(FETCH, goal=["upon(mug, table)"])),
        "unknown predicate 'upon'; did",
    ),
    "goal that is no fact": (says(answer(FETCH, goal=["the mug, on the table"])), "column"),
    "goal with too few names": (says(answer(FETCH, goal=["on(mug)"])), "on takes 2 of these"),
    "goal that contradicts itself": (
        says(answer(FETCH, goal=[UNTIL_TABLE, f"not {UNTIL_TABLE}"])),
        "the goal contradicts itself: on\\(mug, table\\) and not on\\(mug, table\\)",
    ),
    "step that cannot be done": (says(answer(FETCH[1:])), "step 1, PickUp\\(mug, drawer/board\\): it needs open"),
    "plan that stops too early": (says(answer(FETCH[:2])), "after the last step the goal's on\\(mug, table\\)"),
    "10,000 actions": (says(answer([TUCK] * 10_000)), "at most 100 items"),
    "tool call instead of JSON": (calls_a_tool("PickUp", {"object": "mug"}), "you called PickUp; there are no tools"),
    "answer at its limit of length": (stops_at_length(RIGHT), "cut off at the limit of its length"),
}
SERVERS: dict[str, tuple[Way, str]] = {
    "timeout": (sleeps(6.0, says(RIGHT)), "no whole answer after"),
    "429": (fails(429), "status 429"),
    "500": (fails(500), "status 500"),
    "cut-off stream": (breaks_off(completion({"content": json.dumps(RIGHT)})), "peer closed"),
}


def planner(server: Server, tries: int = 3, timeout: float = 10.0) -> LanguagePlanner:
    parameters = EndpointLimits(timeout=timeout, retries=1, backoff=0.01)
    endpoint = HttpEndpoint(EndpointAddress(server.base_url, "small"), parameters)
    return LanguagePlanner(tries, endpoint=endpoint)


def assert_right(proposal: Proposal) -> None:
    assert str(proposal.plan) == "OpenContainer(drawer)\nPickUp(mug, drawer/board)\nPutDown(mug, table)"
    assert proposal.problem.goal == parse_literals(UNTIL_TABLE)


def test_a_right_answer_is_taken_as_it_is() -> None:
    with serving(says(RIGHT)) as server:
        proposal = planner(server).propose(kitchen())
    assert_right(proposal)
    assert proposal.usage.questions == 1
    assert len(server.questions) == 1


@pytest.mark.parametrize("way", ANSWERS)
def test_a_faulty_answer_is_never_taken_and_its_fault_is_reported(way: str) -> None:
    behaviour, fault = ANSWERS[way]
    with serving(behaviour) as server:
        with pytest.raises(NoValidAnswerError, match=fault):
            planner(server, tries=2).propose(kitchen())
        assert len(server.questions) == 2


@pytest.mark.parametrize("way", ANSWERS)
def test_a_model_that_corrects_itself_is_believed(way: str) -> None:
    behaviour, _ = ANSWERS[way]
    with serving(behaviour, says(RIGHT)) as server:
        proposal = planner(server).propose(kitchen())
    assert_right(proposal)
    assert proposal.usage.questions == 2
    told = [message["content"] for message in server.questions[1]["messages"]]
    assert told[-1].startswith("That answer was not accepted:\n- ")
    assert all(len(text) < 10_000 for text in told)


@pytest.mark.parametrize("way", [pytest.param("timeout", marks=pytest.mark.slow), *list(SERVERS)[1:]])
def test_a_server_that_gives_no_answer_ends_in_an_error_and_one_that_recovers_in_a_plan(way: str) -> None:
    behaviour, reason = SERVERS[way]
    timeout = 0.3 if way == "timeout" else 10.0
    with serving(behaviour) as server, pytest.raises(EndpointUnreachableError, match=reason):
        planner(server, timeout=timeout).propose(kitchen())
    with serving(behaviour, says(RIGHT)) as server:
        assert_right(planner(server, timeout=2.5 if way == "timeout" else 10.0).propose(kitchen()))


def test_a_whole_day_of_faults_ends_after_the_allowed_questions() -> None:
    with serving(*(behaviour for behaviour, _ in ANSWERS.values())) as server:
        with pytest.raises(NoValidAnswerError, match="no valid answer in 4 tries") as error:
            planner(server, tries=4).propose(kitchen())
        assert str(error.value).endswith(f"; it was: {error.value.answer}")
        assert 0 < len(error.value.answer) <= 301
        assert len(server.questions) == 4


@pytest.mark.parametrize("way", [says(answer([], [], "I may not touch knives.")), refuses("I may not touch knives.")])
def test_a_refusal_is_reported_in_the_models_words(way: Way) -> None:
    with serving(way) as server:
        with pytest.raises(ModelRefusedError, match=r"^I may not touch knives\.$"):
            planner(server).propose(kitchen())
        assert len(server.questions) == 1


def test_what_a_model_says_cannot_move_the_terminals_cursor_nor_fill_it() -> None:
    refusal = says(answer([], [], "\x1b[2J\x1b[H all\ndone " + "x" * 9999))
    with serving(refusal) as server, pytest.raises(ModelRefusedError) as refused:
        planner(server).propose(kitchen())
    assert str(refused.value).startswith("[2J [H all done xxx")
    assert len(str(refused.value)) < 400
    with serving(says(answer(FETCH, ["on(mug, \x1b[2J)", "x" * 99_999])), calls_a_tool("\x1b[2J", {})) as server:
        for _ in range(2):
            with pytest.raises(NoValidAnswerError) as faulty:
                planner(server, tries=1).propose(kitchen())
            assert str(faulty.value).isprintable()
            assert len(str(faulty.value)) < 1000


def test_a_goal_that_holds_already_takes_no_steps() -> None:
    with serving(says(answer([], ["on(mug, drawer/board)"]))) as server:
        assert planner(server).propose(kitchen()).plan.actions == ()


def test_steps_that_the_goal_does_not_need_are_left_out() -> None:
    further = [step("TuckArm"), *FETCH, step("OpenContainer", container="fridge")]
    with serving(says(answer(further))) as server:
        assert_right(planner(server).propose(kitchen()))


def test_a_goal_that_is_given_is_not_the_models_to_choose() -> None:
    problem = replace(kitchen(), instruction="", goal=parse_literals(UNTIL_TABLE))
    with serving(says(answer([], ["hand_empty"])), says(RIGHT)) as server:
        assert_right(planner(server).propose(problem))
    assert "Reach on(mug, table)" in server.questions[0]["messages"][1]["content"]


def test_an_answer_in_a_code_fence_is_read() -> None:
    with serving(says(f"```json\n{json.dumps(RIGHT)}\n```")) as server:
        assert_right(planner(server).propose(kitchen()))


def test_what_further_checks_say_goes_back_to_the_model() -> None:
    with serving(says(RIGHT)) as server:
        one_armed = replace(planner(server, tries=2), further=lambda problem, plan: ["no arm reaches the drawer"])
        with pytest.raises(NoValidAnswerError, match="no arm reaches the drawer"):
            one_armed.propose(kitchen())
        assert "no arm reaches the drawer" in server.questions[1]["messages"][-1]["content"]


def test_all_its_errors_are_planning_errors() -> None:
    assert issubclass(LanguageError, PlanningError)
