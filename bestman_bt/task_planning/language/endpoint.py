"""Client for chat completions of OpenAI-compatible endpoints, bounded in time, size and attempts."""

from __future__ import annotations

import ipaddress
import json
import logging
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import httpx
from pydantic import BaseModel, Field, ValidationError

from bestman_bt.http_client import (
    Answer,
    AnswerRefusedError,
    NoAnswerError,
    PostLimits,
    RetryableError,
    post_json,
    with_retries,
)
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatReply, ChatRequest, Usage
from bestman_bt.task_planning.language.errors import (
    EndpointNotSetError,
    EndpointReplyError,
    EndpointUnreachableError,
    quoted,
)


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
    """A completion. Only the first choice is used; a completion without a choice or message is invalid."""

    choices: list[_Choice] = Field(min_length=1)
    tokens: _Tokens | None = Field(None, alias="usage")

    @property
    def usage(self) -> _Tokens:
        """Return the token counts of the server; 0 without counts."""
        return self.tokens or _Tokens(prompt_tokens=0, completion_tokens=0)

    def reply(self, usage: Usage) -> ChatReply:
        """Return the answer without its envelope."""
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
    """Parse a body. Raises ValueError with a short text if it violates the protocol."""
    try:
        return Completion.model_validate_json(content)
    except ValidationError as error:
        raise ValueError(_first_of(error)) from None


def read_refusal(content: str) -> str:
    """Return the server's reason for a refusal, shortened."""
    try:
        error = _Refusal.model_validate_json(content).error
    except ValidationError:
        return ""
    return quoted(error if isinstance(error, str) else error.message)


def _first_of(error: ValidationError) -> str:
    fault = error.errors(include_input=False, include_url=False)[0]
    place = ".".join(str(part) for part in fault["loc"])
    return f"{place}: {fault['msg']}" if place else str(fault["msg"])


class ApiKey:
    """An API key that signs requests and removes itself from texts; its ``repr`` is empty.

    Raises EndpointNotSetError, without the key, for characters that are not allowed in an HTTP header: the libraries
    below would show the whole header in their error.
    """

    def __init__(self, text: str) -> None:
        text = text.strip()
        if not all("!" <= character <= "~" for character in text):
            raise EndpointNotSetError("the API key has characters other than visible ASCII")
        self._text = text

    def __bool__(self) -> bool:
        return bool(self._text)

    def __repr__(self) -> str:
        return "ApiKey(…)" if self._text else "ApiKey()"

    def headers(self) -> dict[str, str]:
        """Return the header ``Authorization``; empty without a key."""
        return {"Authorization": f"Bearer {self._text}"} if self._text else {}

    def removed_from(self, text: str) -> str:
        """Return the text with the key replaced by ``…``, plain or as JSON, because some servers quote it."""
        if not self._text:
            return text
        quoted = json.dumps(self._text)[1:-1]
        for written in (quoted.replace("/", "\\/"), quoted, self._text):
            text = text.replace(written, "…")
        return text


BASE_URL, MODEL, API_KEY, PRICES = (f"BESTMAN_LLM_{name}" for name in ("BASE_URL", "MODEL", "API_KEY", "PRICES"))

_HEADERS = {"User-Agent": "bestman-bt", "Accept": "application/json"}
_LOG = logging.getLogger(__name__)
_OPTIONAL = ("response_format", "temperature", "max_tokens")


@dataclass(frozen=True)
class EndpointLimits(PostLimits):
    """``PostLimits``, and ``max_tokens`` of an answer.

    A server that refuses ``temperature``, ``max_tokens`` or the schema is asked again without it.
    """

    connect_timeout: float = 5.0
    timeout: float = 60.0
    retries: int = 3
    backoff: float = 0.5
    max_reply: int = 1_000_000
    max_tokens: int = 4096
    temperature: float = 0.0


@dataclass(frozen=True)
class EndpointAddress:
    """``base_url``: up to ``/v1``; ``model``: name; ``prices``: US dollars per million tokens, in and out."""

    base_url: str
    model: str
    key: ApiKey = field(default_factory=lambda: ApiKey(""))
    prices: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        try:
            url = httpx.URL(self.base_url)
        except httpx.InvalidURL:
            url = httpx.URL()
        if url.scheme not in ("http", "https") or not url.host or url.userinfo or url.query or url.fragment:
            # Not quoted: passwords and keys stand in addresses, too.
            raise EndpointNotSetError(f"{BASE_URL} is not an address of the form https://host/v1")

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> EndpointAddress:
        """Read BESTMAN_LLM_BASE_URL, _MODEL, _API_KEY and _PRICES.

        Raises EndpointNotSetError naming the missing variable.
        """
        missing = [name for name in (BASE_URL, MODEL) if not environment.get(name, "").strip()]
        if missing:
            raise EndpointNotSetError(
                f"set {' and '.join(missing)} in the environment (and {API_KEY} if the endpoint requires a key)"
            )
        key = ApiKey(environment.get(API_KEY, ""))
        prices = _prices(environment.get(PRICES, ""))
        return cls(environment[BASE_URL].strip(), environment[MODEL].strip(), key, prices)

    @property
    def is_local(self) -> bool:
        """Return whether the endpoint runs on this machine."""
        host = httpx.URL(self.base_url).host
        try:
            return ipaddress.ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"


class HttpEndpoint(ChatEndpoint):
    """Posts to ``<base_url>/chat/completions``; keeps no state between questions."""

    def __init__(self, address: EndpointAddress, limits: EndpointLimits | None = None) -> None:
        self.address = address
        self.limits = limits or EndpointLimits()

    def complete(self, request: ChatRequest) -> ChatReply:
        """Implement ``ChatEndpoint``; logs seconds, tokens and dollars."""
        body, started = self._body(request), time.monotonic()
        try:
            completion = with_retries(lambda: self._completion(body), self.limits, self._warn)
        except NoAnswerError as error:
            raise EndpointUnreachableError(f"{self._name} {error}") from error
        reply = completion.reply(self._usage(completion, time.monotonic() - started))
        _LOG.info("%s: %s", self._name, reply.usage)
        return reply

    @property
    def _name(self) -> str:
        return f"{self.address.model} at {httpx.URL(self.address.base_url).host}"

    def _warn(self, reason: str) -> None:
        _LOG.warning("%s: %s", self._name, reason)

    def _body(self, request: ChatRequest) -> dict[str, Any]:
        return {
            "model": self.address.model,
            "messages": [{"role": message.role, "content": message.content} for message in request.messages],
            "response_format": {
                "type": "json_schema",
                "json_schema": {"name": "answer", "strict": True, "schema": request.schema},
            },
            "temperature": self.limits.temperature,
            "max_tokens": self.limits.max_tokens,
        }

    def _usage(self, completion: Completion, seconds: float) -> Usage:
        asked, answered = completion.usage.prompt_tokens, completion.usage.completion_tokens
        prices = self.address.prices
        dollars = None if prices is None else (asked * prices[0] + answered * prices[1]) / 1e6
        return Usage(seconds, asked, answered, dollars)

    def _completion(self, body: dict[str, Any]) -> Completion:
        """Make one attempt; optional fields that the server refuses are omitted from then on."""
        while True:
            answer = self._post(body)
            if answer.status == 200:
                return self._read(answer)
            why = read_refusal(self._text(answer))
            refused = next((field for field in _OPTIONAL if field in body and field in why), None)
            if answer.status not in (400, 422) or refused is None:
                raise EndpointReplyError(f"{self._name}: status {answer.status}{f': {why}' if why else ''}")
            _LOG.info("%s does not take %s, asking without", self._name, refused)
            del body[refused]

    def _post(self, body: Mapping[str, Any]) -> Answer:
        address = self.address
        url = address.base_url.rstrip("/") + "/chat/completions"
        headers = {**_HEADERS, **address.key.headers()}
        try:
            # A proxy of the environment is the way out of the building, not to this machine.
            return post_json(url, body, self.limits, headers, through_proxy=not address.is_local)
        except RetryableError as error:
            raise RetryableError(address.key.removed_from(str(error)), error.wait) from None
        except AnswerRefusedError as error:
            raise EndpointReplyError(f"{self._name}: {error}") from error

    def _read(self, answer: Answer) -> Completion:
        try:
            return read_completion(self._text(answer))
        except ValueError as error:
            raise RetryableError(f"the answer violates the protocol: {error}") from error

    def _text(self, answer: Answer) -> str:
        return self.address.key.removed_from(answer.content.decode(errors="replace"))


def _prices(text: str) -> tuple[float, float] | None:
    if not text.strip():
        return None
    try:
        asked, answered = (float(price) for price in text.split(";"))
    except ValueError:
        asked = answered = -1.0
    if not (0.0 <= asked < float("inf") and 0.0 <= answered < float("inf")):
        raise EndpointNotSetError(
            f"{PRICES} is {text!r}; two numbers 'in;out' are expected, US dollars per million tokens"
        )
    return asked, answered
