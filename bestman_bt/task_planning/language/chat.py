"""A conversation with a language model, whoever holds it: questions, answers and what they cost."""

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
    """The conversation so far, and the JSON schema that the next answer has to follow."""

    messages: tuple[Message, ...]
    schema: Mapping[str, Any]

    def followed_by(self, *messages: Message) -> ChatRequest:
        """Return the same, some turns later."""
        return ChatRequest((*self.messages, *messages), self.schema)


@dataclass(frozen=True)
class Usage:
    """What questions took: seconds of waiting, tokens, and US dollars (None: no price is known)."""

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
    """An answer: ``text``; ``refusal``: the model's own words where it declined; ``tools``: names of tools that it
    wanted to call instead; ``complete``: False where it stopped at a limit of length.
    """

    text: str
    usage: Usage
    refusal: str | None = None
    tools: tuple[str, ...] = ()
    complete: bool = True


class ChatEndpoint(ABC):
    """Somebody who answers a conversation."""

    @abstractmethod
    def complete(self, request: ChatRequest) -> ChatReply:
        """Ask once; raises EndpointUnreachableError or EndpointReplyError where no answer comes."""
