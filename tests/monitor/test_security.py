"""Who may speak to the monitor: host names, origins, tokens, sizes; and what its answers forbid browsers."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import Callable
from typing import Any
from urllib.parse import quote

import pytest
from starlette.responses import PlainTextResponse
from websockets.exceptions import ConnectionClosed, InvalidStatus

from bestman_bt.monitor.control_client import page_address
from bestman_bt.monitor.security import HEADERS, AccessRules, Guard, is_loopback, new_token
from bestman_bt.monitor.server import LARGEST_REQUEST, STATIC
from tests.monitor.conftest import Monitor

StartMonitor = Callable[..., Monitor]
TOKEN = "a-token-of-some-length"


@pytest.fixture
def open_monitor(start_monitor: StartMonitor) -> Monitor:
    """On loopback, without a token."""
    return start_monitor()


@pytest.fixture
def guarded(start_monitor: StartMonitor) -> Monitor:
    """With a token."""
    return start_monitor(token=TOKEN)


def handshake(monitor: Monitor, **headers: str) -> tuple[int, str]:
    """Status and text of the answer to a WebSocket handshake with these headers and no others of its own."""
    told = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13"}
    told |= {"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", **headers}
    with socket.create_connection(("127.0.0.1", monitor.port), 10.0) as connection:
        lines = ["GET /ws HTTP/1.1", *(f"{name}: {value}" for name, value in told.items())]
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        answer = connection.recv(1 << 16).decode(errors="replace")
    return int(answer.split()[1]), answer


def refused(monitor: Monitor, **headers: str) -> int:
    """The HTTP status of a WebSocket handshake that is refused."""
    with pytest.raises(InvalidStatus) as info, monitor.page(**headers):
        pass
    return info.value.response.status_code


def test_loopback_is_distinguished_from_addresses_that_others_reach() -> None:
    assert [is_loopback(host) for host in ("127.0.0.1", "127.0.0.9", "::1", "localhost")] == [True] * 4
    assert [
        is_loopback(host)
        for host in ("0.0.0.0", "::", "192.168.1.4", "10.0.0.1", "fe80::1", "robot", "127.0.0.1.evil.org", "")
    ] == [False] * 8
    assert AccessRules.of("0.0.0.0", 1, TOKEN).hosts == frozenset()
    assert AccessRules.of("127.0.0.9", 1, TOKEN).hosts == {"localhost", "127.0.0.1", "::1", "127.0.0.9"}


def test_tokens_are_long_and_never_the_same() -> None:
    assert len({new_token() for _ in range(100)}) == 100
    assert min(len(new_token()) for _ in range(100)) >= 32


@pytest.mark.parametrize(
    "origin", ["http://evil.org", "null", "", "http://127.0.0.1:1", "https://127.0.0.1.evil.org", "http://["]
)
def test_a_page_of_somebody_else_cannot_open_the_socket(open_monitor: Monitor, origin: str) -> None:
    assert refused(open_monitor, Origin=origin) == 403


@pytest.mark.parametrize("host", ["evil.org", "evil.org:{port}", "127.0.0.1.evil.org", ""])
def test_a_foreign_name_that_points_to_this_machine_is_refused(open_monitor: Monitor, host: str) -> None:
    named = host.format(port=open_monitor.port)
    with open_monitor.http() as http:
        assert http.get("/health", headers={"Host": named}).status_code in (400, 403)
        assert http.get("/health", headers={"Host": f"localhost:{open_monitor.port}"}).status_code == 200


@pytest.mark.parametrize(
    "host", ["evil.org:{port}", "127.0.0.1.evil.org:{port}", "10.0.0.7:{port}", "127.0.0.1@evil.org:{port}"]
)
def test_a_foreign_name_opens_no_socket_even_for_a_page_of_its_own(open_monitor: Monitor, host: str) -> None:
    """As after DNS rebinding: to the browser, the page and the socket are of one origin."""
    named = host.format(port=open_monitor.port)
    status, _ = handshake(open_monitor, Host=named, Origin=f"http://{named}")
    assert status == 403
    for own in (f"localhost:{open_monitor.port}", f"127.0.0.1:{open_monitor.port}", f"[::1]:{open_monitor.port}"):
        status, _ = handshake(open_monitor, Host=own, Origin=f"http://{own}")
        assert status == 101


@pytest.mark.parametrize(
    ("origin", "status"),
    [
        ("http://localhost:{port}", 101),
        ("https://LOCALHOST:{port}", 101),
        ("http://127.0.0.1:{port}", 403),
        ("http://localhost", 403),
        ("http://localhost:{port}.evil.org", 403),
        ("http://localhost:{port}@evil.org", 403),
        ("ftp://localhost:{port}", 403),
        ("file://localhost:{port}", 403),
        ("//localhost:{port}", 403),
        ("localhost:{port}", 403),
    ],
)
def test_the_origin_is_the_very_host_that_is_asked(open_monitor: Monitor, origin: str, status: int) -> None:
    port = open_monitor.port
    told, _ = handshake(open_monitor, Host=f"localhost:{port}", Origin=origin.format(port=port))
    assert told == status


def test_a_handshake_without_an_origin_is_refused(open_monitor: Monitor) -> None:
    assert handshake(open_monitor, Host=open_monitor.host)[0] == 403


def test_off_loopback_any_name_is_served_with_the_token_and_none_without(start_monitor: StartMonitor) -> None:
    monitor = start_monitor(host="0.0.0.0", token=TOKEN)
    named = f"robot.lan:{monitor.port}"
    bearer = f"Bearer {TOKEN}"
    with monitor.http() as http:
        assert http.get("/runs/x/images/1.jpg", headers={"Host": named}).status_code == 401
        assert http.get("/health", headers={"Host": named, "Authorization": bearer}).json()["read_only"] is False
        assert http.get("/health", headers={"Host": "", "Authorization": bearer}).status_code in (400, 403)
    origin = f"http://{named}"
    assert handshake(monitor, Host=named, Origin=origin)[0] == 403
    assert handshake(monitor, Host=named, Origin=origin, Authorization=bearer)[0] == 101
    assert handshake(monitor, Host=named, Origin="http://evil.org", Authorization=bearer)[0] == 403


def test_answers_forbid_foreign_scripts_and_frames(open_monitor: Monitor) -> None:
    with open_monitor.http() as http:
        for path in ("/health", "/", "/runs/x/images/1.jpg", "/nothing"):
            headers = http.get(path).headers
            policy = dict(part.strip().split(" ", 1) for part in headers["content-security-policy"].split(";"))
            assert policy.pop("img-src") == "'self' data:"
            forbidden = {"default-src", "base-uri", "form-action", "frame-ancestors"}
            assert {name for name, allowed in policy.items() if allowed == "'none'"} == forbidden
            assert {name for name, allowed in policy.items() if allowed == "'self'"} == policy.keys() - forbidden
            assert {"script-src", "style-src", "connect-src"} < policy.keys()
            assert (headers["x-content-type-options"], headers["x-frame-options"]) == ("nosniff", "DENY")
            assert headers["referrer-policy"] == "no-referrer"  # the token stands in an address
            assert headers["cross-origin-opener-policy"] == headers["cross-origin-resource-policy"] == "same-origin"
            assert "server" not in headers


class Door:
    """A guard before an application that lets everybody in."""

    def __init__(self, rules: AccessRules) -> None:
        self.guard = Guard(PlainTextResponse("inside"), rules)

    def ask(
        self, *headers: tuple[str, str], path: str = "/", query: str = "", method: str = "GET"
    ) -> tuple[int, dict[str, str]]:
        """Status and headers of the answer."""
        told: list[Any] = []

        async def send(message: Any) -> None:
            told.append(message)

        async def receive() -> Any:
            return {"type": "http.request", "body": b"", "more_body": False}

        raw = [(name.lower().encode(), value.encode("latin-1")) for name, value in (("Host", "robot:80"), *headers)]
        scope = {"type": "http", "method": method, "path": path, "query_string": query.encode(), "headers": raw}
        asyncio.run(self.guard(scope, receive, send))
        return told[0]["status"], {name.decode(): value.decode() for name, value in told[0]["headers"]}

    def cookie(self) -> tuple[str, str]:
        """The cookie that the token is changed for: name and value."""
        told = self.ask(query=f"token={TOKEN}")[1]["set-cookie"]
        name, _, value = told.split(";")[0].partition("=")
        return name, value


@pytest.mark.parametrize(
    ("scheme", "token", "status"),
    [
        ("Bearer", TOKEN, 200),
        ("bEARER", f"  {TOKEN} ", 200),
        ("Basic", TOKEN, 401),
        ("", TOKEN, 401),
        ("Bearer", f"{TOKEN}x", 401),
        ("Bearer", TOKEN[:-1], 401),
        ("Bearer", TOKEN.upper(), 401),
        ("Bearer", "", 401),
        ("Bearer", "é\x80", 401),
    ],
)
def test_only_the_whole_token_of_its_kind_opens(scheme: str, token: str, status: int) -> None:
    door = Door(AccessRules.of("0.0.0.0", 80, TOKEN))
    assert door.ask(("Authorization", f"{scheme} {token}"))[0] == status
    assert door.ask(path="/", query=f"token={quote(token.strip())}")[0] == (303 if token.strip() == TOKEN else 401)


@pytest.mark.parametrize(
    ("host", "path", "query", "status"),
    [
        ("127.0.0.1", "/", "", 403),
        ("0.0.0.0", "/", "", 401),
        ("0.0.0.0", "/", f"token={TOKEN}", 303),
        ("0.0.0.0", "/health", "", 200),
    ],
)
def test_what_is_said_to_strangers_is_guarded_as_the_page_is(host: str, path: str, query: str, status: int) -> None:
    told, headers = Door(AccessRules.of(host, 80, TOKEN)).ask(path=path, query=query)
    assert told == status
    assert {name: headers.get(name.lower()) for name in HEADERS} == HEADERS


def test_the_cookie_is_found_among_others_and_whole() -> None:
    door = Door(AccessRules.of("0.0.0.0", 80, TOKEN))
    name, value = door.cookie()
    ours = f"{name}={value}"
    for cookies in (ours, f"a=1; {ours}; b=2", f"odd:name/@=1; {ours}", f"broken; {ours}", f'{name}="{value}"'):
        assert door.ask(("Cookie", cookies))[0] == 200, cookies
    assert door.ask(("Cookie", "a=1"), ("Cookie", ours))[0] == 200
    for cookies in (f"{ours}x", ours[:-1], f"{name}=", f"x{ours}", f"{name}={TOKEN}", "é=\x80", ""):
        assert door.ask(("Cookie", cookies))[0] == 401, cookies


@pytest.mark.parametrize(
    ("method", "origin", "status"),
    [
        ("POST", "http://robot:80", 200),
        ("POST", "http://evil.org", 403),
        ("DELETE", "http://evil.org", 403),
        ("POST", "null", 403),
        ("GET", "http://evil.org", 200),
        ("HEAD", "http://evil.org", 200),
    ],
)
def test_only_our_own_page_sends_requests_that_change_something(method: str, origin: str, status: int) -> None:
    door = Door(AccessRules.of("0.0.0.0", 80, TOKEN))
    bearer = ("Authorization", f"Bearer {TOKEN}")
    assert door.ask(bearer, ("Origin", origin), method=method)[0] == status


def test_a_cookie_is_of_one_server_and_one_port() -> None:
    rules = AccessRules.of("0.0.0.0", 80, TOKEN)
    name, value = Door(rules).cookie()
    assert Door(rules).ask(("Cookie", f"{name}={value}"))[0] == 401
    other = AccessRules.of("0.0.0.0", 81, TOKEN)
    assert Door(other).cookie()[0] != name
    assert min(len(cookie) for cookie in (value, Door(other).cookie()[1])) >= 32


def test_without_a_token_none_is_asked_for_and_none_is_taken() -> None:
    door = Door(AccessRules.of("127.0.0.1", 80, None))
    assert door.ask()[0] == 403  # by another name
    assert Door(AccessRules(80)).ask(query="token=None")[0] == 200


@pytest.mark.parametrize(
    "path", ["/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/assets/..%2f..%2fserver.py", "//etc/passwd"]
)
def test_files_outside_of_the_page_are_not_served(open_monitor: Monitor, path: str) -> None:
    assert (STATIC.parent / "server.py").is_file()
    with open_monitor.http() as http:
        request = http.build_request("GET", "/")
        request.url = request.url.copy_with(raw_path=path.encode())
        answer = http.send(request)
    assert answer.status_code == 404
    assert "uvicorn" not in answer.text


def test_without_the_token_nothing_is_served(guarded: Monitor) -> None:
    with guarded.http() as http:
        assert [http.get(path).status_code for path in ("/", "/runs/a/images/1.jpg", "/assets/x.js")] == [401] * 3
        assert http.get("/", params={"token": "wrong"}).status_code == 401
        assert http.get("/", params={"token": TOKEN[:-1]}).status_code == 401
        assert http.get("/assets/x.js", params={"token": TOKEN}).status_code == 401
        assert http.get("/health").json() == {"service": "bestman-bt monitor"}
        assert "sockets" in http.get("/health", headers={"Authorization": f"Bearer {TOKEN}"}).json()
    assert refused(guarded) == 403
    assert refused(guarded, Authorization="Bearer wrong") == 403
    assert refused(guarded, Cookie=f"bestman_bt_monitor_{guarded.port}={TOKEN}") == 403


def test_the_token_is_changed_for_a_cookie_that_scripts_cannot_read(guarded: Monitor) -> None:
    with guarded.http() as http:
        answer = http.get("/", params={"token": TOKEN})
        assert (answer.status_code, answer.headers["location"]) == (303, "/")
        told = answer.headers["set-cookie"]
        assert TOKEN not in told
        assert "HttpOnly" in told
        assert "SameSite=strict" in told
        assert http.get("/").status_code != 401
    with guarded.page(Cookie=told.split(";")[0]) as page:
        assert page.next("hello")["runs"] == []
    assert refused(guarded, Cookie=told.split(";")[0], Origin="http://evil.org") == 403


def test_programs_may_show_the_token_in_a_header(guarded: Monitor) -> None:
    with guarded.page(Authorization=f"Bearer {TOKEN}") as page:
        assert page.next("hello")["runs"] == []


def test_addresses_quote_what_a_token_holds() -> None:
    assert page_address("robot", 8750, "a&b#c d/é") == "http://robot:8750/?token=a%26b%23c%20d%2F%C3%A9"
    assert page_address("::1", 1, None) == "http://[::1]:1/"


def test_a_message_that_is_too_long_ends_the_connection(open_monitor: Monitor) -> None:
    with open_monitor.page() as page:
        page.next("hello")
        page.connection.send(json.dumps({"do": "open", "id": "x" * LARGEST_REQUEST}))
        with pytest.raises(ConnectionClosed):
            page.next("answer")
    with open_monitor.page() as page:
        page.next("hello")


def test_binary_messages_end_the_connection(open_monitor: Monitor) -> None:
    with open_monitor.page() as page:
        page.next("hello")
        page.connection.send(b"\0\1")
        with pytest.raises(ConnectionClosed):
            page.next("answer")
