from __future__ import annotations

import gzip
import json
import logging
import threading
import time
import traceback
from pathlib import Path

import pytest

from bestman_bt.task_planning.language.chat import ChatRequest, Message
from bestman_bt.task_planning.language.endpoint import ApiKey, EndpointAddress, EndpointLimits, HttpEndpoint
from bestman_bt.task_planning.language.errors import EndpointNotSetError, EndpointReplyError, EndpointUnreachableError
from tests.answering_server import (
    Handler,
    Server,
    Way,
    breaks_off,
    drips,
    drips_headers,
    drips_without_length,
    raw,
    serving_at,
    sleeps,
)
from tests.task_planning.language.misbehaving_server import completion, fails, says, serving, without

KEY = "sk-very-secret-0123456789"
QUESTION = ChatRequest((Message("system", "be good"), Message("user", "hello")), {"type": "object"})


def endpoint(server: Server, key: str = KEY, **changed: object) -> HttpEndpoint:
    settings = {"timeout": 10.0, "retries": 2, "backoff": 0.01, **changed}
    address = EndpointAddress(server.base_url, "small", ApiKey(key), (3.0, 2.0))
    return HttpEndpoint(address, EndpointLimits(**settings))


def test_only_the_documented_fields_are_sent() -> None:
    with serving(says("hi")) as server:
        assert endpoint(server).complete(QUESTION).text == "hi"
    assert server.questions == [
        {
            "model": "small",
            "messages": [{"role": "system", "content": "be good"}, {"role": "user", "content": "hello"}],
            "response_format": {
                "type": "json_schema",
                "json_schema": {"name": "answer", "strict": True, "schema": {"type": "object"}},
            },
            "temperature": 0.0,
            "max_tokens": 4096,
        }
    ]
    sent = {name.lower(): value for name, value in server.headers[0].items()}
    assert set(sent) == {
        *("host", "user-agent", "accept", "accept-encoding", "connection", "content-length", "content-type"),
        "authorization",
    }
    assert sent["authorization"] == f"Bearer {KEY}"
    assert sent["user-agent"] == "bestman-bt"


def test_without_a_key_no_authorization_is_sent() -> None:
    with serving(says("hi")) as server:
        endpoint(server, key="").complete(QUESTION)
    assert "Authorization" not in server.headers[0]


def test_tokens_and_dollars_are_counted_and_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "bestman_bt")
    with serving(says("hi")) as server:
        usage = endpoint(server).complete(QUESTION).usage
    assert (usage.prompt_tokens, usage.completion_tokens) == (1000, 50)
    assert usage.dollars == pytest.approx(1000 * 3e-6 + 50 * 2e-6)
    assert 0.0 < usage.seconds < 5.0
    assert "1000 + 50 tokens, $0.0031" in caplog.text


@pytest.mark.parametrize(
    ("way", "reason"),
    [
        (fails(429), "status 429"),
        (fails(500), "status 500"),
        (breaks_off(completion({"content": "a long text that is cut off"})), "peer closed"),
        (raw(b"<html>gateway</html>"), "violates the protocol"),
        (raw(b'{"choices": []}'), "choices"),
        (raw(b"[" * 100_000), "violates the protocol"),
    ],
)
def test_a_bad_moment_is_followed_by_another_try_and_a_bad_server_by_an_error(way: object, reason: str) -> None:
    with serving(way, says("better")) as server:
        assert endpoint(server).complete(QUESTION).text == "better"
        assert len(server.questions) == 2
    with serving(way) as server:
        with pytest.raises(EndpointUnreachableError, match=reason):
            endpoint(server, retries=1).complete(QUESTION)
        assert len(server.questions) == 2


@pytest.mark.parametrize("way", [sleeps(4.0, says("too late")), drips, drips_headers, drips_without_length])
def test_a_late_answer_is_given_up_and_asked_for_again(way: Way) -> None:
    with serving(way) as server:
        with pytest.raises(EndpointUnreachableError, match=r"no whole answer after \d+\.\d s"):
            endpoint(server, timeout=0.3, retries=1).complete(QUESTION)
        assert len(server.questions) == 2


def test_an_answer_that_is_packed_without_being_asked_is_refused() -> None:
    bomb = gzip.compress(b" " * 10_000_000)
    assert len(bomb) < 100_000
    with serving(raw(bomb, Content_Encoding="gzip")) as server, pytest.raises(EndpointReplyError, match="compressed"):
        endpoint(server).complete(QUESTION)


@pytest.mark.parametrize(("asked", "waited"), [("7", 7.0), ("100000", 20.0), ("Fri, 31 Dec 2027 23:59:59 GMT", 0.01)])
def test_the_servers_wish_to_wait_is_granted_up_to_a_bound(
    asked: str, waited: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    sleep, here = time.sleep, threading.current_thread()
    # Servers of earlier tests may still be dripping in threads of their own.
    monkeypatch.setattr("time.sleep", lambda s: (waits.append if threading.current_thread() is here else sleep)(s))
    with serving(fails(429, Retry_After=asked), says("better")) as server:
        assert endpoint(server).complete(QUESTION).text == "better"
    assert waits == [waited]


def test_nobody_at_the_address_is_reported_after_all_tries() -> None:
    with serving(says("hi")) as server:
        gone = endpoint(server, retries=1)
    with pytest.raises(EndpointUnreachableError, match=r"small at 127\.0\.0\.1 gave no answer in 2 tries"):
        gone.complete(QUESTION)


def test_waits_between_tries_double_up_to_a_bound_and_each_is_reported(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    waits: list[float] = []
    with serving(says("hi")) as server:
        gone = endpoint(server, retries=4, backoff=3.0, longest_wait=20.0)
    monkeypatch.setattr("time.sleep", waits.append)
    with pytest.raises(EndpointUnreachableError, match="no answer in 5 tries; last failure: .*refused"):
        gone.complete(QUESTION)
    assert waits == [3.0, 6.0, 12.0, 20.0]
    assert "again in 3.0 s" in caplog.text
    assert len(caplog.records) == 5


@pytest.mark.parametrize("field", ["temperature", "max_tokens", "response_format"])
def test_a_server_that_refuses_an_optional_field_is_asked_without_it(field: str) -> None:
    with serving(without(field, says("hi"))) as server:
        assert endpoint(server, retries=0).complete(QUESTION).text == "hi"
    assert [field in question for question in server.questions] == [True, False]


def test_all_that_a_server_refuses_stays_left_out_also_in_later_tries(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "bestman_bt")
    picky = without("temperature", without("max_tokens", says("hi")))
    ways = (raw(b'{"error": "temperature?"}', 422), picky, fails(500), picky)
    with serving(*ways) as server:
        assert endpoint(server, retries=1).complete(QUESTION).text == "hi"
    sent = [("temperature" in question, "max_tokens" in question) for question in server.questions]
    assert sent == [(True, True), (False, True), (False, False), (False, False)]
    assert "small at 127.0.0.1 does not take max_tokens, asking without" in caplog.text


@pytest.mark.parametrize(
    ("way", "words", "asked"),
    [
        (fails(400, "temperature is too high"), "status 400: temperature is too high", 2),
        (fails(400, "too many messages"), "status 400: too many messages", 1),
        (fails(403, "temperature is not for you"), "status 403: temperature is not for you", 1),
        (raw(b"\xff\xfe", 404), "status 404$", 1),
    ],
)
def test_a_refusal_that_leaving_out_a_field_does_not_mend_ends_the_question(way: Way, words: str, asked: int) -> None:
    with serving(way) as server:
        with pytest.raises(EndpointReplyError, match=words):
            endpoint(server).complete(QUESTION)
        assert len(server.questions) == asked


def test_a_refused_question_is_not_repeated_and_reported_in_the_servers_words() -> None:
    with serving(fails(404, "no model small")) as server:
        with pytest.raises(EndpointReplyError, match="status 404: no model small"):
            endpoint(server).complete(QUESTION)
        assert len(server.questions) == 1


def test_a_redirect_is_not_followed() -> None:
    with serving(says("elsewhere")) as other, serving(fails(307, Location=other.base_url)) as server:
        with pytest.raises(EndpointReplyError, match="status 307"):
            endpoint(server).complete(QUESTION)
        assert other.questions == []


def test_an_answer_without_end_is_refused_before_it_fills_the_memory() -> None:
    with serving(says("x" * 50_000)) as server, pytest.raises(EndpointReplyError, match="more than 10000 bytes"):
        endpoint(server, max_reply=10_000).complete(QUESTION)


def test_ten_megabytes_are_given_up_after_the_first() -> None:
    with serving(says("x" * 10_000_000)) as server:
        with pytest.raises(EndpointReplyError, match="more than 1000000 bytes"):
            endpoint(server).complete(QUESTION)
        assert len(server.questions) == 1


def test_the_key_is_in_no_log_error_or_repr(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    errors = []
    ways = (fails(401, f"Incorrect API key provided: {KEY}"), fails(500, KEY), says(f"your key is {KEY}"))
    for way in ways:
        with serving(way) as server:
            asked = endpoint(server, retries=1)
            try:
                assert KEY not in asked.complete(QUESTION).text
            except (EndpointReplyError, EndpointUnreachableError) as error:
                errors.append(str(error))
            assert KEY not in repr(asked.address)
            assert f"Bearer {KEY}" in server.headers[0].values()
    assert len(errors) == 2
    assert KEY not in "\n".join(errors)
    assert KEY not in caplog.text
    assert "127.0.0.1" in caplog.text


def echoes_the_key(*heads: bytes) -> Way:
    """A server that repeats the header with the key where no library expects it."""

    def way(handler: Handler) -> None:
        handler.wfile.write(b"".join((heads[0], handler.headers["Authorization"].encode(), *heads[1:], b"\r\n\r\n")))
        handler.close_connection = True

    return way


@pytest.mark.parametrize(
    "way",
    [
        echoes_the_key(b""),
        echoes_the_key(b"HTTP/1.1 200 OK\r\n", b" : x"),
        echoes_the_key(b"HTTP/1.1 200 OK\r\nContent-Length: ", b""),
        echoes_the_key(b"HTTP/1.1 200 OK\r\nContent-Encoding: ", b""),
        echoes_the_key(b"HTTP/1.1 307 ", b"\r\nLocation: http://127.0.0.1/"),
    ],
    ids=["status line", "header name", "length", "encoding", "reason"],
)
def test_a_key_that_a_broken_answer_echoes_is_in_no_error_and_no_log(
    way: Way, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG, "bestman_bt")
    with serving(way) as server, pytest.raises((EndpointReplyError, EndpointUnreachableError)) as error:
        endpoint(server, retries=1).complete(QUESTION)
    shown = "".join(traceback.format_exception(error.value)) + caplog.text
    assert not any(KEY[i : i + 8] in shown for i in range(len(KEY) - 7))


@pytest.mark.parametrize("key", ["sk-a/b+c==", 'sk-"quoted"', "sk-back\\slash"])
def test_a_key_is_taken_out_also_where_json_writes_it_with_escapes(key: str) -> None:
    slashed = json.dumps({"error": {"message": f"no such key: {key}!"}}).replace("/", "\\/").encode()
    for way in (fails(401, f"no such key: {key}!"), raw(slashed, 401)):
        with serving(way) as server, pytest.raises(EndpointReplyError, match="no such key: …!$"):
            endpoint(server, key=key).complete(QUESTION)
    with serving(says(f"the key {key} is fine")) as server:
        assert endpoint(server, key=key).complete(QUESTION).text == "the key … is fine"


def test_a_key_that_no_header_can_carry_is_refused_without_showing_it() -> None:
    with pytest.raises(EndpointNotSetError, match="visible ASCII") as refused:
        ApiKey("sk-first-line\nsk-second-line")
    assert "sk-" not in str(refused.value)
    assert ApiKey("  sk-1\n").removed_from("sk-1") == "…"


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"BESTMAN_LLM_BASE_URL": ""}, "set BESTMAN_LLM_BASE_URL in"),
        ({"BESTMAN_LLM_BASE_URL": "", "BESTMAN_LLM_MODEL": " "}, "set BESTMAN_LLM_BASE_URL and BESTMAN_LLM_MODEL in"),
        ({"BESTMAN_LLM_BASE_URL": "ftp://host/v1"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_BASE_URL": "https://me:hidden@host/v1"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_BASE_URL": "https://host/v1?key=hidden"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_BASE_URL": "http://host:x/v1"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_PRICES": "cheap"}, "BESTMAN_LLM_PRICES is 'cheap'"),
        ({"BESTMAN_LLM_PRICES": "1;nan"}, "BESTMAN_LLM_PRICES is '1;nan'"),
        ({"BESTMAN_LLM_PRICES": "-1;1"}, "BESTMAN_LLM_PRICES is '-1;1'"),
        ({"BESTMAN_LLM_PRICES": "inf;1"}, "BESTMAN_LLM_PRICES is 'inf;1'"),
        ({"BESTMAN_LLM_PRICES": "1;inf"}, "BESTMAN_LLM_PRICES is '1;inf'"),
        ({"BESTMAN_LLM_BASE_URL": "https:///v1"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_BASE_URL": "https://host/v1#hidden"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_BASE_URL": "https://hidden@host/v1"}, "BESTMAN_LLM_BASE_URL is not an address"),
        ({"BESTMAN_LLM_API_KEY": "hidden\nhidden"}, "the API key has characters"),
    ],
)
def test_what_is_wrong_in_the_environment_is_named(changed: dict[str, str], words: str) -> None:
    environment = {"BESTMAN_LLM_BASE_URL": "https://host/v1", "BESTMAN_LLM_MODEL": "m", **changed}
    with pytest.raises(EndpointNotSetError, match=words) as refused:
        EndpointAddress.from_environment(environment)
    assert "hidden" not in str(refused.value)


def test_the_environment_gives_address_model_key_and_prices() -> None:
    environment = {
        "BESTMAN_LLM_BASE_URL": " https://host/v1/ ",
        "BESTMAN_LLM_MODEL": " m ",
        "BESTMAN_LLM_API_KEY": KEY,
        "BESTMAN_LLM_PRICES": "0.15;0.6",
    }
    address = EndpointAddress.from_environment(environment)
    assert (address.base_url, address.model, address.prices) == ("https://host/v1/", "m", (0.15, 0.6))
    assert address.key.headers() == {"Authorization": f"Bearer {KEY}"}
    assert KEY not in repr(address)
    free = EndpointAddress.from_environment({**environment, "BESTMAN_LLM_API_KEY": " ", "BESTMAN_LLM_PRICES": "0;0"})
    assert (free.key.headers(), free.prices) == ({}, (0.0, 0.0))
    assert EndpointAddress.from_environment({**environment, "BESTMAN_LLM_PRICES": " "}).prices is None


@pytest.mark.parametrize(
    ("host", "local"),
    [
        ("localhost:8080", True),
        ("[::1]", True),
        ("127.0.0.2", True),
        ("10.0.0.1", False),
        ("localhost.example.org", False),
        ("host", False),
    ],
)
def test_only_this_machine_is_local(host: str, local: bool) -> None:
    assert EndpointAddress(f"http://{host}/v1", "m").is_local is local


def test_what_is_elsewhere_is_asked_through_the_proxy_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_PROXY", "")
    with serving_at("http://llm.example/v1/chat/completions", says("by proxy")) as proxy:
        monkeypatch.setenv("HTTP_PROXY", f"http://127.0.0.1:{proxy.server_address[1]}")
        assert HttpEndpoint(EndpointAddress("http://llm.example/v1", "m")).complete(QUESTION).text == "by proxy"


def test_a_proxy_of_the_environment_does_not_stand_before_this_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HTTP_PROXY", "http://127.0.0.1:9")
    monkeypatch.setenv("ALL_PROXY", "http://127.0.0.1:9")
    with serving(says("hi")) as server:
        assert endpoint(server).complete(QUESTION).text == "hi"


def test_nothing_of_this_machine_is_in_the_question(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOSTNAME", "kitchen-robot-7")
    with serving(says("hi")) as server:
        endpoint(server).complete(QUESTION)
    sent = server.raw[0].decode() + json.dumps(server.headers[0])
    assert str(Path.home()) not in sent
    assert "kitchen-robot-7" not in sent
