"""Conversations with a language model: questions, answers and costs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True)
class Message:
    """One turn of the conversation."""

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
