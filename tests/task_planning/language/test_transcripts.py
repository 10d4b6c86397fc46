from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bestman_bt.task_planning.language.chat import RecordingEndpoint, ReplayEndpoint, open_transcript
from bestman_bt.task_planning.language.endpoint import ApiKey, EndpointAddress, EndpointLimits, HttpEndpoint
from bestman_bt.task_planning.language.errors import EndpointReplyError, TranscriptError
from bestman_bt.task_planning.language.from_text import LanguagePlanner
from tests.answering_server import Way
from tests.task_planning.language.kitchen_problem import RIGHT, kitchen
from tests.task_planning.language.misbehaving_server import fails, says, serving

KEY = "sk-very-secret-0123456789"


def record(path: Path, *ways: Way) -> str:
    """Plan at a server with these ways; returns the plan."""
    parameters = EndpointLimits(timeout=20.0, retries=1, backoff=0.01)
    with serving(*ways) as server, path.open("w") as file:
        endpoint = HttpEndpoint(EndpointAddress(server.base_url, "small", ApiKey(KEY)), parameters)
        return str(LanguagePlanner(endpoint=RecordingEndpoint(endpoint, file)).plan(kitchen()))


def replayed(path: Path, tries: int = 4) -> LanguagePlanner:
    return LanguagePlanner(tries, endpoint=ReplayEndpoint(path))


def test_a_recorded_conversation_gives_the_same_plan_without_a_server(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    plan = record(path, says("first some prose"), says(RIGHT))
    assert str(replayed(path).plan(kitchen())) == plan
    assert len(path.read_text().splitlines()) == 2
    assert KEY not in path.read_text()


def test_usage_is_that_of_the_recording(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    record(path, says(RIGHT))
    first, second = (replayed(path).propose(kitchen()).usage for _ in range(2))
    assert first == second
    assert (first.prompt_tokens, first.completion_tokens) == (1000, 50)


def test_a_recorded_failure_fails_again(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    with pytest.raises(EndpointReplyError):
        record(path, fails(404, "no such model"))
    with pytest.raises(EndpointReplyError, match="status 404: no such model"):
        replayed(path).plan(kitchen())


def test_another_question_is_refused_with_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    record(path, says(RIGHT))
    told = r"talk\.jsonl:1: another question was recorded: its messages differ; .* version of bestman-bt that"
    with pytest.raises(TranscriptError, match=told):
        replayed(path).plan(replace(kitchen(), instruction="bring the can"))


def test_more_questions_than_were_recorded_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    record(path, says("prose"), says(RIGHT))
    path.write_text(path.read_text().splitlines()[0] + "\n")
    with pytest.raises(TranscriptError, match="the transcript ends after 1 questions; one more is asked"):
        replayed(path).plan(kitchen())


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("no JSON\n", "not a line of a transcript: it is not JSON"),
        ("{}\n", "not a line of a transcript: request: Field required"),
        ('{"request": {}, "reply": {"text": 3}}\n', "not a line of a transcript: reply.text: "),
        ("[" * 9999 + "\n", "not a line of a transcript: it is not JSON"),
    ],
)
def test_a_damaged_transcript_is_refused_with_file_and_line(tmp_path: Path, content: str, words: str) -> None:
    path = tmp_path / "talk.jsonl"
    path.write_text(content)
    with pytest.raises(TranscriptError, match=rf"talk\.jsonl:1: {words}"):
        replayed(path).plan(kitchen())


def test_an_exchange_that_ends_neither_way_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "talk.jsonl"
    record(path, says(RIGHT))
    request = json.loads(path.read_text())["request"]
    path.write_text(json.dumps({"request": request, "failure": {"error": "SystemExit", "text": ""}}) + "\n")
    with pytest.raises(TranscriptError, match="neither a reply nor a known failure"):
        replayed(path).plan(kitchen())


def test_a_transcript_that_cannot_be_written_is_reported_before_anything_is_asked(tmp_path: Path) -> None:
    with pytest.raises(TranscriptError, match="Is a directory"):
        open_transcript(tmp_path)


def test_a_transcript_that_is_not_there_is_reported(tmp_path: Path) -> None:
    with pytest.raises(TranscriptError, match="nothing.jsonl"):
        ReplayEndpoint(tmp_path / "nothing.jsonl")
