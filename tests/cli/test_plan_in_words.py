from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.answering_server import Server
from tests.cli.command_line import Answer
from tests.cli.record_shipped_transcript import DRAWER, INSTRUCTION, PROPOSED, TRANSCRIPT
from tests.task_planning.language.misbehaving_server import says, serving

KEY = "sk-very-secret-0123456789"
FETCH = {
    "refusal": None,
    "goal": ["on(cup, table)"],
    "plan": [
        {"ability": "Search", "arguments": {"object": "cup", "place": "counter/top"}},
        {"ability": "PickUp", "arguments": {"object": "cup", "place": "counter/top"}},
        {"ability": "PutAt", "arguments": {"object": "cup", "place": "table/top"}},
    ],
}


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> Callable[[Server], None]:
    """Set the environment for a server."""

    def set_environment(server: Server) -> None:
        monkeypatch.setenv("BESTMAN_LLM_BASE_URL", server.base_url)
        monkeypatch.setenv("BESTMAN_LLM_MODEL", "small")
        monkeypatch.setenv("BESTMAN_LLM_API_KEY", KEY)

    return set_environment


@pytest.mark.slow
def test_an_instruction_becomes_a_checked_tree_and_cost_and_goal_are_printed_but_never_the_key(
    bestman_bt: Callable[..., Answer], folder: Path, at: Callable[[Server], None]
) -> None:
    with serving(says("I will fetch the cup!"), says(FETCH)) as server:
        at(server)
        answer = bestman_bt(
            *("plan", "put the cup on the table", "--planner", "language", "-o", "tree.xml"),
            *("--record", "talk.jsonl", "--json"),
        )
    assert answer.code == 0, answer.err
    assert answer.document["goal"] == ["on(cup, table/top)"]
    assert [step["ability"] for step in answer.document["plan"]] == ["Search", "PickUp", "PutAt"]
    assert "Invalid JSON" in answer.err
    assert "2 questions" in answer.err
    assert "understood as: on(cup, table/top)" in answer.err
    written = [(folder / name).read_text() for name in ("tree.xml", "talk.jsonl")]
    assert all(KEY not in text for text in (*written, answer.out, answer.err))
    assert bestman_bt("validate", "tree.xml").code == 0
    assert len([json.loads(line) for line in written[1].splitlines()]) == 2


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("planner", "answered"), [("language", PROPOSED), ("symbolic", {**PROPOSED, "plan": None})])
def test_a_mug_is_looked_for_where_the_instruction_reports_that_it_is(
    bestman_bt: Callable[..., Answer], at: Callable[[Server], None], planner: str, answered: dict[str, object]
) -> None:
    told = {name: value for name, value in answered.items() if value is not None or name == "refusal"}
    with serving(says(told)) as server:
        at(server)
        answer = bestman_bt("plan", INSTRUCTION, "--planner", planner, "--json")
    assert answer.code == 0, answer.err
    assert len(server.questions) == 1
    assert answer.document["goal"] == ["on(mug, table/top)"]
    assert [tuple(step.values()) for step in answer.document["plan"]] == [
        ("OpenContainer", DRAWER),
        ("Search", "mug", DRAWER),
        ("PickUp", "mug", DRAWER),
        ("PutAt", "mug", "table/top"),
    ]


@pytest.mark.slow
def test_the_shipped_transcript_answers_without_an_endpoint(
    bestman_bt: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("BESTMAN_LLM_BASE_URL", raising=False)
    answer = bestman_bt("plan", INSTRUCTION, "--planner", "language", "--replay", TRANSCRIPT)
    assert "another question was recorded" not in answer.err, "python -m tests.cli.record_shipped_transcript"
    assert answer.code == 0, answer.err
    assert "it needs open(drawer_chest/drawer_1), which does not hold then" in answer.err
    assert answer.out.split("\n")[-2] == "  4. PutAt(mug, table/top)"


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Somebody at a terminal, who types so."""
    ours, theirs = os.openpty()
    with os.fdopen(theirs) as reading:
        monkeypatch.setattr(sys, "stdin", reading)
        yield lambda text: os.write(ours, text.encode()) and None
    os.close(ours)


def test_what_a_model_made_of_a_text_is_shown_and_run_only_when_agreed(
    bestman_bt: Callable[..., Answer],
    folder: Path,
    at: Callable[[Server], None],
    terminal: Callable[[str], None],
) -> None:
    with serving(says(FETCH)) as server:
        at(server)
        terminal("n\n")
        answer = bestman_bt("plan", "put the cup on the table", "--planner", "language", "--run", "--scene", "kitchen")
    assert answer.code == 130, answer.err
    assert answer.err.index("understood as: on(cup, table/top)") < answer.err.index("Run it?")
    assert not (folder / "runs").exists()


def test_a_plan_beyond_the_limits_gives_no_tree(
    bestman_bt: Callable[..., Answer], folder: Path, at: Callable[[Server], None]
) -> None:
    with serving(says(FETCH)) as server:
        at(server)
        answer = bestman_bt(
            *("plan", "put the cup on the table", "--planner", "language", "-o", "tree.xml", "--limits", "steps=2")
        )
    assert answer.code == 1
    assert "no plan: no valid answer in 4 tries" in answer.err
    assert answer.err.count('it was: {"') == 5  # each of the four, and the last one once more
    assert not (folder / "tree.xml").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "set BESTMAN_LLM_BASE_URL and BESTMAN_LLM_MODEL in the environment"),
        (("--limits", "fast"), "'fast' is not a limit"),
        (("--limits", "without=frigde"), "the limits name an unknown thing 'frigde'"),
        (("--replay", "nothing.jsonl"), "nothing.jsonl"),
    ],
)
def test_wrong_input_is_reported_before_anything_is_asked(
    bestman_bt: Callable[..., Answer], monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    for name in ("BESTMAN_LLM_BASE_URL", "BESTMAN_LLM_MODEL"):
        monkeypatch.delenv(name, raising=False)
        if "without=frigde" in arguments:
            monkeypatch.setenv(name, "http://127.0.0.1:9/v1")
    answer = bestman_bt("plan", "put the cup on the table", "--planner", "language", *arguments)
    assert answer.code == 2
    assert words in answer.err
