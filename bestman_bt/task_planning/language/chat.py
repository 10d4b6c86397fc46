"""Conversations with a language model: questions, answers and costs, and recorded conversations."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TextIO

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from bestman_bt.task_planning.language.errors import (
    EndpointReplyError,
    EndpointUnreachableError,
    LanguageError,
    TranscriptError,
)


@dataclass(frozen=True)
class Message:
    """One message of the conversation."""

    role: Literal["system", "user", "assistant"]
    content: str


@dataclass(frozen=True)
class ChatRequest:
    """The conversation so far, and the JSON schema of the next answer."""

    messages: tuple[Message, ...]
    schema: Mapping[str, Any]

    def followed_by(self, *messages: Message) -> ChatRequest:
        """Return the request with further messages."""
        return ChatRequest((*self.messages, *messages), self.schema)


@dataclass(frozen=True)
class Usage:
    """Cost of the questions: seconds of waiting, tokens, and US dollars (None: prices are unknown)."""

    seconds: float = 0.0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    dollars: float | None = None
    questions: int = 1

    def __add__(self, other: Usage) -> Usage:
        dollars = None if self.dollars is None or other.dollars is None else self.dollars + other.dollars
        return Usage(
            self.seconds + other.seconds,
            self.prompt_tokens + other.prompt_tokens,
            self.completion_tokens + other.completion_tokens,
            dollars,
            self.questions + other.questions,
        )

    def __str__(self) -> str:
        asked = "1 question" if self.questions == 1 else f"{self.questions} questions"
        price = "no price set" if self.dollars is None else f"${self.dollars:.4f}"
        return f"{asked}, {self.seconds:.2f} s, {self.prompt_tokens} + {self.completion_tokens} tokens, {price}"


@dataclass(frozen=True)
class ChatReply:
    """An answer: ``text``; ``refusal``: the model's words if it declined; ``tools``: tools that it tried to call.

    ``complete``: False if it stopped at a length limit.
    """

    text: str
    usage: Usage
    refusal: str | None = None
    tools: tuple[str, ...] = ()
    complete: bool = True


class ChatEndpoint(ABC):
    """An endpoint that answers conversations."""

    @abstractmethod
    def complete(self, request: ChatRequest) -> ChatReply:
        """Send one request. Raises EndpointUnreachableError or EndpointReplyError if there is no valid answer."""


_ENDED_BY = {error.__name__: error for error in (EndpointUnreachableError, EndpointReplyError)}


class _Failure(BaseModel):
    error: str
    text: str


class _Exchange(BaseModel):
    model_config = ConfigDict(extra="forbid")

    request: dict[str, Any]
    reply: ChatReply | None = None
    failure: _Failure | None = None


class RecordingEndpoint(ChatEndpoint):
    """Forwards to another endpoint and writes each question with its answer or error to an open file."""

    def __init__(self, endpoint: ChatEndpoint, file: TextIO) -> None:
        self._endpoint = endpoint
        self._file = file

    def complete(self, request: ChatRequest) -> ChatReply:
        """Implement ``ChatEndpoint``."""
        try:
            reply = self._endpoint.complete(request)
        except (EndpointUnreachableError, EndpointReplyError) as error:
            self._write(request, failure={"error": type(error).__name__, "text": str(error)})
            raise
        self._write(request, reply=asdict(reply))
        return reply

    def _write(self, request: ChatRequest, **outcome: object) -> None:
        self._file.write(json.dumps({"request": asdict(request), **outcome}) + "\n")
        self._file.flush()


def open_transcript(path: Path) -> TextIO:
    """Return a file to record to. Raises TranscriptError if it cannot be written."""
    try:
        return path.open("w", encoding="utf-8")
    except OSError as error:
        raise TranscriptError(f"{path}: {error.strerror}") from error


def _first_of(error: ValidationError) -> str:
    fault = error.errors(include_url=False)[0]
    if fault["type"] == "json_invalid":
        return "it is not JSON"
    return ".".join(str(part) for part in fault["loc"]) + f": {fault['msg']}"


class ReplayEndpoint(ChatEndpoint):
    """Returns the recorded answers in order, for the recorded questions only.

    Raises TranscriptError with file and line if the file is damaged, or the questions differ from the recorded ones.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._line = 0
        try:
            self._lines = path.read_text(encoding="utf-8").splitlines()
        except (OSError, UnicodeDecodeError) as error:
            raise TranscriptError(f"{path}: {error}") from error

    def complete(self, request: ChatRequest) -> ChatReply:
        """Implement ``ChatEndpoint``."""
        if self._line >= len(self._lines):
            raise TranscriptError(f"{self._path}: the transcript ends after {self._line} questions; one more is asked")
        self._line += 1
        exchange = self._exchange(self._lines[self._line - 1])
        self._compare(exchange.request, asdict(request))
        if exchange.reply is not None:
            return exchange.reply
        failure = exchange.failure
        if failure is None or failure.error not in _ENDED_BY:
            raise self._error("neither a reply nor a known failure")
        raised: LanguageError = _ENDED_BY[failure.error](failure.text)
        raise raised

    def _exchange(self, line: str) -> _Exchange:
        try:
            return TypeAdapter(_Exchange).validate_json(line)
        except ValidationError as error:
            raise self._error(f"not a line of a transcript: {_first_of(error)}") from None

    def _compare(self, recorded: dict[str, Any], asked: dict[str, Any]) -> None:
        asked = json.loads(json.dumps(asked))
        for name in sorted(recorded.keys() | asked.keys()):
            if recorded.get(name) != asked.get(name):
                fits = "a transcript replays only with the input and the version of bestman-bt that recorded it"
                raise self._error(f"another question was recorded: its {name} differ; {fits}")

    def _error(self, why: str) -> TranscriptError:
        return TranscriptError(f"{self._path}:{self._line}: {why}")
