"""An HTTP client with retries that POSTs JSON to a server that may be slow, busy or faulty.

Every attempt is bounded in time and bytes. Redirects are not followed, because they would send the request elsewhere.
"""

from __future__ import annotations

import functools
import socket
import ssl
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, TypeVar

import httpx

from bestman_bt.errors import Error

Answered = TypeVar("Answered")

_BUSY = frozenset({408, 409, 425, 429})


@dataclass(frozen=True)
class PostLimits:
    """Limits of a request and of its retries.

    ``connect_timeout``, ``timeout``: seconds for the connection and for each whole attempt. ``retries``: further
    attempts after a temporary failure, the first ``backoff`` seconds later, then doubling each time, or after the delay
    requested by the server, at most ``longest_wait`` seconds. ``max_reply``: largest answer, bytes.
    """

    connect_timeout: float
    timeout: float
    retries: int
    backoff: float
    max_reply: int
    longest_wait: float = 20.0


@dataclass(frozen=True)
class Answer:
    """The HTTP status and the whole body, ``content``."""

    status: int
    content: bytes


class RetryableError(Error):
    """A temporary failure; ``wait``: seconds until the next attempt, if the server requests a delay."""

    def __init__(self, reason: str, wait: float = 0.0) -> None:
        super().__init__(reason)
        self.wait = wait


class NoAnswerError(Error):
    """Every attempt failed; the message gives their number and the last reason."""


class AnswerRefusedError(Error):
    """The answer exceeds the size limit, or uses an encoding that was not requested."""


def with_retries(
    ask: Callable[[], Answered], limits: PostLimits, tell: Callable[[str], None] = lambda reason: None
) -> Answered:
    """Call ``ask`` until it succeeds and return its result; RetryableError leads to another attempt.

    ``tell``: called with the reason of each failure and the delay before the next attempt.
    Raises NoAnswerError after the last attempt.
    """
    reason = ""
    for left in range(limits.retries, -1, -1):
        try:
            return ask()
        except RetryableError as error:
            reason = str(error)
            wait = min(error.wait or limits.backoff * 2 ** (limits.retries - left), limits.longest_wait)
        tell(f"{reason}; again in {wait:.1f} s" if left else reason)
        if left:
            time.sleep(wait)
    tries = f"{limits.retries + 1} tries" if limits.retries else "one try"
    raise NoAnswerError(f"gave no answer in {tries}; last failure: {reason}")


def post_json(
    url: str,
    body: Mapping[str, Any],
    limits: PostLimits,
    headers: Mapping[str, str],
    *,
    through_proxy: bool,
) -> Answer:
    """Send one POST request. ``through_proxy``: use the proxy of the environment, if any.

    Raises:
        RetryableError: the server is unreachable, late, busy (408, 409, 425, 429), fails (5xx) or disconnects.
        AnswerRefusedError: the answer is too long or has an unexpected encoding.
        httpx.InvalidURL, httpx.UnsupportedProtocol: ``url`` is not a valid address.
    """
    allowed = httpx.Timeout(limits.timeout, connect=min(limits.connect_timeout, limits.timeout))
    watch = _Deadline(limits.timeout)
    sent = {"Accept-Encoding": "identity", **headers}
    try:
        with (
            httpx.Client(
                timeout=allowed, trust_env=through_proxy, follow_redirects=False, verify=_certificates(through_proxy)
            ) as client,
            watch,
            client.stream("POST", url, json=body, headers=sent, extensions={"trace": watch.connected}) as answer,
        ):
            content = _content(answer, limits.max_reply)
            if watch.passed:  # an answer without a length seems whole where it was cut
                raise httpx.ReadTimeout("cut")
    except httpx.UnsupportedProtocol:
        raise
    except httpx.HTTPError as error:
        if isinstance(error, httpx.TimeoutException) or watch.passed:
            raise RetryableError(f"no whole answer after {watch.elapsed:.1f} s") from error
        raise RetryableError(str(error) or type(error).__name__) from error
    if answer.status_code in _BUSY or answer.status_code >= 500:
        raise RetryableError(f"status {answer.status_code}", _seconds(answer.headers.get("Retry-After", "")))
    return Answer(answer.status_code, content)


@functools.cache
def _certificates(of_environment: bool) -> ssl.SSLContext:
    """Return the trusted certificates, cached: loading them takes longer than a local request."""
    return httpx.create_ssl_context(trust_env=of_environment)


def _content(answer: httpx.Response, most: int) -> bytes:
    packed = answer.headers.get("Content-Encoding", "identity")
    if packed != "identity":  # a few bytes can unpack to more than a machine holds
        raise AnswerRefusedError(
            "the answer is compressed, although no compression was requested"
        )  # not quoted: it may echo a key
    content = bytearray()
    for chunk in answer.iter_raw():
        content += chunk
        if len(content) > most:
            raise AnswerRefusedError(f"the answer has more than {most} bytes")
    return bytes(content)


def _seconds(text: str) -> float:
    """Return the seconds of a header ``Retry-After``; 0 for a date or an empty one."""
    return float(text) if text.isascii() and text.isdigit() else 0.0


@dataclass
class _Deadline:
    """Cuts the connection after ``seconds``: httpx's limits hold for each read alone, so that a server which sends a
    byte at long intervals would never be late.
    """

    seconds: float
    passed: bool = False
    _sockets: list[socket.socket] = field(default_factory=list)

    def __enter__(self) -> None:
        self._started = time.monotonic()
        self._timer = threading.Timer(self.seconds, self._cut)
        self._timer.daemon = True
        self._timer.start()

    def __exit__(self, *_: object) -> None:
        self._timer.cancel()

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""
        return time.monotonic() - self._started

    def connected(self, event: str, info: Mapping[str, Any]) -> None:
        """Record the connection; see httpx's request extension ``trace``."""
        if event.endswith(("connect_tcp.complete", "start_tls.complete")):
            self._sockets.append(info["return_value"].get_extra_info("socket"))

    def _cut(self) -> None:
        self.passed = True
        for each in self._sockets:
            with suppress(OSError):  # it may have ended just now
                each.shutdown(socket.SHUT_RDWR)
