"""The body of an answer to ``POST /chat/completions``, as far as it is used."""

from __future__ import annotations

from pydantic import BaseModel, Field, ValidationError

from bestman_bt.task_planning.language.chat import ChatReply, Usage
from bestman_bt.task_planning.language.quoting import quoted


class _Function(BaseModel):
    name: str = "?"


class _ToolCall(BaseModel):
    function: _Function = Field(default_factory=_Function)


class _Message(BaseModel):
    content: str | None = None
    refusal: str | None = None
    tool_calls: list[_ToolCall] | None = None


class _Choice(BaseModel):
    message: _Message
    finish_reason: str | None = None


class _Tokens(BaseModel):
    prompt_tokens: int = Field(0, ge=0)
    completion_tokens: int = Field(0, ge=0)


class Completion(BaseModel):
    """The first choice counts; none, or one without a message, breaks the protocol."""

    choices: list[_Choice] = Field(min_length=1)
    tokens: _Tokens | None = Field(None, alias="usage")

    @property
    def usage(self) -> _Tokens:
        """The tokens that the server counted; 0 where it counts none."""
        return self.tokens or _Tokens(prompt_tokens=0, completion_tokens=0)

    def reply(self, usage: Usage) -> ChatReply:
        """The answer without its wrapping."""
        choice = self.choices[0]
        message, refusal = choice.message, choice.message.refusal
        if choice.finish_reason == "content_filter" and not refusal:
            refusal = "the endpoint's content filter stopped the answer"
        return ChatReply(
            message.content or "",
            usage,
            refusal or None,
            tuple(call.function.name for call in message.tool_calls or ()),
            complete=choice.finish_reason != "length",
        )


class _Why(BaseModel):
    message: str


class _Refusal(BaseModel):
    error: _Why | str


def read_completion(content: str) -> Completion:
    """Parse a body; ValueError with a short text where it breaks the protocol."""
    try:
        return Completion.model_validate_json(content)
    except ValidationError as error:
        raise ValueError(_first_of(error)) from None


def read_refusal(content: str) -> str:
    """Why the server refused the question, in its words as far as it gives any, shortened."""
    try:
        error = _Refusal.model_validate_json(content).error
    except ValidationError:
        return ""
    return quoted(error if isinstance(error, str) else error.message)


def _first_of(error: ValidationError) -> str:
    fault = error.errors(include_input=False, include_url=False)[0]
    place = ".".join(str(part) for part in fault["loc"])
    return f"{place}: {fault['msg']}" if place else str(fault["msg"])
