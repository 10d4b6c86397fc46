"""Asking a server over HTTP: what is tried again, after how long, and where bytes and time end."""

from __future__ import annotations

import gzip
from typing import Any

import httpx
import pytest

from bestman_bt import http_client
from bestman_bt.http_client import (
    Answer,
    AnswerRefusedError,
    NoAnswerError,
    PostLimits,
    RetryableError,
    post_json,
    with_retries,
)
from tests.answering_server import Way, drips, drips_headers, drips_without_length, raw, serving_at

LIMITS = PostLimits(connect_timeout=2.0, timeout=2.0, retries=3, backoff=0.5, max_reply=100, longest_wait=3.0)


def post(way: Way, limits: PostLimits = LIMITS, **headers: str) -> Answer:
    with serving_at("/ask", way) as server:
        return post_json(server.url, {"question": 1}, limits, headers, through_proxy=False)


@pytest.fixture
def waits(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """What was waited, without waiting."""
    found: list[float] = []
    monkeypatch.setattr(http_client.time, "sleep", found.append)
    return found


def asking(*outcomes: Exception | str) -> Any:
    left = list(outcomes)

    def ask() -> str:
        outcome = left.pop(0)
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    return ask


def test_each_try_waits_twice_as_long_as_the_one_before_up_to_the_longest_and_none_after_the_last(
    waits: list[float],
) -> None:
    told: list[str] = []
    limits = PostLimits(1.0, 1.0, retries=4, backoff=0.5, max_reply=1, longest_wait=3.0)
    with pytest.raises(NoAnswerError, match="gave no answer in 5 tries; last failure: busy 4"):
        with_retries(asking(*(RetryableError(f"busy {n}") for n in range(5))), limits, told.append)
    assert waits == [0.5, 1.0, 2.0, 3.0]
    assert told == [f"busy {n}; again in {wait:.1f} s" for n, wait in enumerate(waits)] + ["busy 4"]


def test_a_server_that_names_its_wait_gets_it_up_to_the_longest(waits: list[float]) -> None:
    assert with_retries(asking(RetryableError("a", 1.5), RetryableError("b", 60.0), "yes"), LIMITS) == "yes"
    assert waits == [1.5, 3.0]


def test_without_retries_it_is_asked_once_and_another_failure_is_not_asked_again(waits: list[float]) -> None:
    once = PostLimits(1.0, 1.0, retries=0, backoff=1.0, max_reply=1)
    with pytest.raises(NoAnswerError, match="in one try; last failure: late"):
        with_retries(asking(RetryableError("late"), "never"), once)
    with pytest.raises(ValueError, match="wrong"):
        with_retries(asking(ValueError("wrong"), "never"), LIMITS)
    assert waits == []


def test_the_headers_go_with_the_question_and_nothing_packed_is_asked_for() -> None:
    with serving_at("/ask", raw(b"yes")) as server:
        answer = post_json(server.url, {"q": [1, "ü"]}, LIMITS, {"Authorization": "Bearer k"}, through_proxy=False)
        (headers,) = server.headers
        assert server.questions == [{"q": [1, "ü"]}]
    assert answer == Answer(200, b"yes")
    assert (headers["Authorization"], headers["Accept-Encoding"]) == ("Bearer k", "identity")


@pytest.mark.parametrize("status", [408, 409, 425, 429, 500, 503, 599])
def test_a_busy_or_failing_server_is_to_be_asked_again_when_it_says(status: int) -> None:
    with pytest.raises(RetryableError, match=f"status {status}") as caught:
        post(raw(b"", status, Retry_After="7"))
    assert caught.value.wait == 7.0


@pytest.mark.parametrize("told", ["-1", "soon", "1e9", "٣", "Wed, 21 Oct 2026 07:28:00 GMT"])
def test_a_wait_that_is_no_number_of_seconds_is_none(told: str) -> None:
    with pytest.raises(RetryableError) as caught:
        post(lambda handler: _with_raw_header(handler, told))
    assert caught.value.wait == 0.0


def _with_raw_header(handler: Any, told: str) -> None:
    handler.wfile.write(b"HTTP/1.1 503 Busy\r\nContent-Length: 0\r\nRetry-After: " + told.encode() + b"\r\n\r\n")


@pytest.mark.parametrize("status", [400, 401, 404, 422, 499])
def test_a_refusal_is_an_answer(status: int) -> None:
    assert post(raw(b"no", status)) == Answer(status, b"no")


def test_a_redirect_is_not_followed_so_that_the_key_goes_nowhere_else() -> None:
    with serving_at("/stolen", raw(b"thanks")) as elsewhere:
        answer = post(raw(b"", 307, Location=elsewhere.url), Authorization="Bearer secret")
        assert elsewhere.questions == []
    assert answer.status == 307


def test_an_answer_of_the_most_bytes_is_read_and_one_more_is_refused() -> None:
    assert len(post(raw(b"x" * 100)).content) == 100
    with pytest.raises(AnswerRefusedError, match="more than 100 bytes"):
        post(raw(b"x" * 101))


def test_a_packed_answer_is_refused_however_short() -> None:
    with pytest.raises(AnswerRefusedError, match="compressed"):
        post(raw(gzip.compress(b"yes"), Content_Encoding="gzip"))


@pytest.mark.parametrize("way", [drips, drips_without_length, drips_headers])
def test_a_server_that_sends_a_byte_now_and_then_is_cut_off_in_time(way: Way) -> None:
    short = PostLimits(connect_timeout=2.0, timeout=0.2, retries=0, backoff=1.0, max_reply=10_000)
    with pytest.raises(RetryableError, match="no whole answer after 0"):
        post(way, short)


def test_nobody_there_is_to_be_asked_again_and_what_is_no_address_is_not() -> None:
    with serving_at("/gone", raw(b"")) as server:
        gone = server.url
    with pytest.raises(RetryableError):
        post_json(gone, {}, LIMITS, {}, through_proxy=False)
    with pytest.raises(httpx.UnsupportedProtocol):
        post_json("ftp://127.0.0.1/", {}, LIMITS, {}, through_proxy=False)


def test_the_proxy_of_the_environment_is_used_only_where_it_may_be(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("no_proxy", "NO_PROXY"):
        monkeypatch.delenv(name, raising=False)
    with serving_at("/ask", raw(b"direct")) as server, serving_at("", raw(b"")) as proxy:
        monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{proxy.server_address[1]}")
        assert post_json(server.url, {}, LIMITS, {}, through_proxy=False).content == b"direct"
        assert proxy.questions == []
        assert post_json("http://robot.invalid/ask", {}, LIMITS, {}, through_proxy=True).status == 404
        assert len(proxy.questions) == 1
