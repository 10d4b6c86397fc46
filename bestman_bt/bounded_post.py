"""One POST of JSON to a server that may be late, busy, talkative or broken, and asking again.

Whatever the server does, a try ends within its time and its bytes. Redirects are not followed: they would carry the
question elsewhere.
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
    """``connect_timeout``, ``timeout``: seconds for the connection, and for each whole try. ``retries``: further tries
    after one that may go better the next time, ``backoff`` seconds later, then twice that, and so on, or as long as the
    server asks for; at most ``longest_wait``. ``max_reply``: bytes.
    """

    connect_timeout: float
    timeout: float
    retries: int
    backoff: float
    max_reply: int
    longest_wait: float = 20.0


@dataclass(frozen=True)
class Answer:
    """``content``: the whole body."""

    status: int
    content: bytes


class TryAgainError(Error):
    """A try that may go better the next time, ``wait`` seconds later if the server asks for it."""

    def __init__(self, reason: str, wait: float = 0.0) -> None:
        super().__init__(reason)
        self.wait = wait


class NoAnswerError(Error):
    """No answer in all tries; the text has their number and the reason of the last."""


class AnswerRefusedError(Error):
    """An answer longer than is read, or packed in a way that was not asked for: reading it has no bound."""


def ask_again(
    ask: Callable[[], Answered], limits: PostLimits, tell: Callable[[str], None] = lambda reason: None
) -> Answered:
    """What ``ask`` returns, which raises TryAgainError where another try may go better; NoAnswerError after the last.

    ``tell``: is given the reason of each failure, and when it is asked again.
    """
    reason = ""
    for left in range(limits.retries, -1, -1):
        try:
            return ask()
        except TryAgainError as error:
            reason = str(error)
            wait = min(error.wait or limits.backoff * 2 ** (limits.retries - left), limits.longest_wait)
        tell(f"{reason}; again in {wait:.1f} s" if left else reason)
        if left:
            time.sleep(wait)
    tries = f"{limits.retries + 1} tries" if limits.retries else "one try"
    raise NoAnswerError(f"gave no answer in {tries}; the last: {reason}")


def post_json(
    url: str,
    body: Mapping[str, Any],
    limits: PostLimits,
    headers: Mapping[str, str],
    *,
    through_proxy: bool,
) -> Answer:
    """Post once. ``through_proxy``: that of the environment, if it names one.

    Raises TryAgainError where the server cannot be reached, is late, busy (408, 409, 425, 429) or fails (5xx), or
    breaks off; AnswerRefusedError; httpx.InvalidURL or httpx.UnsupportedProtocol for what is no address.
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
            raise TryAgainError(f"no whole answer after {watch.elapsed:.1f} s") from error
        raise TryAgainError(str(error) or type(error).__name__) from error
    if answer.status_code in _BUSY or answer.status_code >= 500:
        raise TryAgainError(f"status {answer.status_code}", _seconds(answer.headers.get("Retry-After", "")))
    return Answer(answer.status_code, content)


@functools.cache
def _certificates(of_environment: bool) -> ssl.SSLContext:
    """Whom to trust, read once: that takes longer than a question to this machine."""
    return httpx.create_ssl_context(trust_env=of_environment)


def _content(answer: httpx.Response, most: int) -> bytes:
    packed = answer.headers.get("Content-Encoding", "identity")
    if packed != "identity":  # a few bytes can unpack to more than a machine holds
        raise AnswerRefusedError("the answer is packed, which was not asked for")  # not quoted: it may echo a key
    content = bytearray()
    for chunk in answer.iter_raw():
        content += chunk
        if len(content) > most:
            raise AnswerRefusedError(f"the answer has more than {most} bytes")
    return bytes(content)


def _seconds(text: str) -> float:
    """Of a header ``Retry-After``; 0 where it gives a date or nothing."""
    return float(text) if text.isascii() and text.isdigit() else 0.0


@dataclass
class _Deadline:
    """Cuts the connection after ``seconds``: httpx's limits hold for each read alone, so that a server which sends a
    byte now and then would never be late.
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
        """See httpx's request extension ``trace``: takes note of the connection."""
        if event.endswith(("connect_tcp.complete", "start_tls.complete")):
            self._sockets.append(info["return_value"].get_extra_info("socket"))

    def _cut(self) -> None:
        self.passed = True
        for each in self._sockets:
            with suppress(OSError):  # it may have ended just now
                each.shutdown(socket.SHUT_RDWR)
