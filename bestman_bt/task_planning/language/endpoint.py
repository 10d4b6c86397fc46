"""Asks any OpenAI-compatible endpoint for chat completions, within bounds of time, size and tries."""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import httpx

from bestman_bt.task_planning.language.api_key import ApiKey
from bestman_bt.task_planning.language.chat import ChatEndpoint, ChatReply, ChatRequest, Usage
from bestman_bt.task_planning.language.completion import Completion, read_completion, read_refusal
from bestman_bt.task_planning.language.errors import (
    EndpointNotSetError,
    EndpointReplyError,
    EndpointUnreachableError,
)

BASE_URL, MODEL, API_KEY, PRICES = (f"BESTMAN_LLM_{name}" for name in ("BASE_URL", "MODEL", "API_KEY", "PRICES"))

_HEADERS = {"User-Agent": "bestman-bt", "Accept": "application/json", "Accept-Encoding": "identity"}
_LOG = logging.getLogger(__name__)
_OPTIONAL = ("response_format", "temperature", "max_tokens")
_TRY_AGAIN = frozenset({408, 409, 429})


@dataclass(frozen=True)
class EndpointParameters:
    """``connect_timeout``, ``timeout``: seconds for the connection, and for each whole try. ``retries``: further tries
    where the server cannot be reached, is late, busy (429) or fails (5xx), and where its answer breaks off; before them
    it waits ``backoff`` seconds, then twice that, and so on, or as long as the server asks; at most ``longest_wait``.
    ``max_reply``: bytes. ``max_tokens``: of an answer. A server that refuses ``temperature``, ``max_tokens`` or the
    schema is asked again without.
    """

    connect_timeout: float = 5.0
    timeout: float = 60.0
    retries: int = 3
    backoff: float = 0.5
    longest_wait: float = 20.0
    max_reply: int = 1_000_000
    max_tokens: int = 4096
    temperature: float = 0.0


@dataclass(frozen=True)
class EndpointAddress:
    """Where to ask: ``base_url`` up to ``/v1``, ``model``; ``prices``: US dollars per million tokens, in and out."""

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
            raise EndpointNotSetError(f"{BASE_URL} is no address of the form https://host/v1")

    @classmethod
    def from_environment(cls, environment: Mapping[str, str] = os.environ) -> EndpointAddress:
        """Read BESTMAN_LLM_BASE_URL, _MODEL, _API_KEY and _PRICES; EndpointNotSetError names what is missing."""
        missing = [name for name in (BASE_URL, MODEL) if not environment.get(name, "").strip()]
        if missing:
            raise EndpointNotSetError(
                f"set {' and '.join(missing)} in the environment (and {API_KEY} if the endpoint wants a key)"
            )
        key = ApiKey(environment.get(API_KEY, ""))
        prices = _prices(environment.get(PRICES, ""))
        return cls(environment[BASE_URL].strip(), environment[MODEL].strip(), key, prices)

    @property
    def is_local(self) -> bool:
        """Whether the endpoint runs on this machine."""
        host = httpx.URL(self.base_url).host
        try:
            return ipaddress.ip_address(host).is_loopback
        except ValueError:
            return host == "localhost"


class HttpEndpoint(ChatEndpoint):
    """Posts to ``<base_url>/chat/completions``; keeps nothing between two questions.

    Follows no redirects: they would carry the question elsewhere.
    """

    def __init__(self, address: EndpointAddress, parameters: EndpointParameters | None = None) -> None:
        self.address = address
        self.parameters = parameters or EndpointParameters()

    def complete(self, request: ChatRequest) -> ChatReply:
        """See ChatEndpoint; logs seconds, tokens and dollars."""
        # A proxy of the environment is the way out of the building, not to this machine.
        with httpx.Client(headers=_HEADERS, trust_env=not self.address.is_local) as client:
            return self._ask(client, self._body(request))

    @property
    def _name(self) -> str:
        return f"{self.address.model} at {httpx.URL(self.address.base_url).host}"

    def _ask(self, client: httpx.Client, body: dict[str, Any]) -> ChatReply:
        p, reason = self.parameters, ""
        started, tries_left = time.monotonic(), p.retries + 1
        while tries_left:
            tries_left -= 1
            try:
                completion = self._post(client, body)
            except _FieldRefusedError as refused:
                # Not one of the tries: it happens at most once for each optional field.
                tries_left += 1
                _LOG.info("%s does not take %s, asking without", self._name, refused.field)
                del body[refused.field]
            except _TryAgainError as error:
                reason = str(error)
                wait = min(error.wait or p.backoff * 2 ** (p.retries - tries_left), p.longest_wait)
                _LOG.warning("%s: %s%s", self._name, reason, f"; again in {wait:.1f} s" if tries_left else "")
                if tries_left:
                    time.sleep(wait)
            else:
                reply = completion.reply(self._usage(completion, time.monotonic() - started))
                _LOG.info("%s: %s", self._name, reply.usage)
                return reply
        counted = f"{p.retries + 1} tries" if p.retries else "one try"
        raise EndpointUnreachableError(f"{self._name} gave no answer in {counted}; the last: {reason}")

    def _body(self, request: ChatRequest) -> dict[str, Any]:
        return {
            "model": self.address.model,
            "messages": [{"role": message.role, "content": message.content} for message in request.messages],
            "response_format": {
                "type": "json_schema",
                "json_schema": {"name": "answer", "strict": True, "schema": request.schema},
            },
            "temperature": self.parameters.temperature,
            "max_tokens": self.parameters.max_tokens,
        }

    def _usage(self, completion: Completion, seconds: float) -> Usage:
        asked, answered = completion.usage.prompt_tokens, completion.usage.completion_tokens
        prices = self.address.prices
        dollars = None if prices is None else (asked * prices[0] + answered * prices[1]) / 1e6
        return Usage(seconds, asked, answered, dollars)

    def _post(self, client: httpx.Client, body: Mapping[str, Any]) -> Completion:
        p, address = self.parameters, self.address
        url = address.base_url.rstrip("/") + "/chat/completions"
        limits = httpx.Timeout(p.timeout, connect=min(p.connect_timeout, p.timeout))
        request = client.build_request("POST", url, json=body, timeout=limits)
        started = time.monotonic()
        try:
            answer = client.send(address.key.sign(request), stream=True, follow_redirects=False)
            with contextlib.closing(answer):
                content = self._content(answer, started)
        except httpx.TimeoutException as error:
            raise _TryAgainError(f"no answer after {time.monotonic() - started:.1f} s") from error
        except httpx.HTTPError as error:
            raise _TryAgainError(address.key.removed_from(str(error)) or type(error).__name__) from error
        return self._read(answer, address.key.removed_from(content.decode(errors="replace")), body)

    def _content(self, answer: httpx.Response, started: float) -> bytes:
        p, content = self.parameters, bytearray()
        for chunk in answer.iter_bytes():
            content += chunk
            if len(content) > p.max_reply:
                raise EndpointReplyError(f"{self._name}: the answer has more than {p.max_reply} bytes")
            # The library's limit holds for each read: a server that drips would never be late.
            if time.monotonic() - started > p.timeout:
                raise _TryAgainError(f"not done after {p.timeout:g} s")
        return bytes(content)

    def _read(self, answer: httpx.Response, content: str, body: Mapping[str, Any]) -> Completion:
        status = answer.status_code
        if status in _TRY_AGAIN or status >= 500:
            raise _TryAgainError(f"status {status}", _seconds(answer.headers.get("Retry-After", "")))
        if status != 200:
            why = read_refusal(content)
            for optional in _OPTIONAL:
                if status in (400, 422) and optional in body and optional in why:
                    raise _FieldRefusedError(optional)
            raise EndpointReplyError(f"{self._name}: status {status}{f': {why}' if why else ''}")
        try:
            return read_completion(content)
        except ValueError as error:
            raise _TryAgainError(f"the answer breaks the protocol: {error}") from error


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


def _seconds(text: str) -> float:
    """Of a header ``Retry-After``; 0 where it gives a date or nothing."""
    return float(text) if text.isascii() and text.isdigit() else 0.0


class _TryAgainError(Exception):
    """A try that may go better the next time, ``wait`` seconds later if the server asks for it."""

    def __init__(self, reason: str, wait: float = 0.0) -> None:
        super().__init__(reason)
        self.wait = wait


class _FieldRefusedError(Exception):
    """The server does not know an optional field of the question."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.field = name
