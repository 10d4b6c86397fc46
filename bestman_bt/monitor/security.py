"""Access control of the server: only its own pages and host names, with a token if other machines can reach it."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import cookie_parser
from starlette.responses import JSONResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bestman_bt.monitor.control_client import SERVICE

SHORTEST_TOKEN = 16
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; font-src 'self'; "
        "connect-src 'self'; manifest-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}
FORBIDDEN = 4403
"""WebSocket close code of a refused handshake; the browser sees HTTP 403."""


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a server that listens there."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def new_token() -> str:
    """Return a random token."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class AccessRules:
    """``token``: None if none is required. ``hosts``: accepted host names; empty: any.

    Host names are checked on loopback, because a foreign page could resolve its own name to this machine.
    """

    port: int
    token: str | None = None
    hosts: frozenset[str] = frozenset()

    @classmethod
    def of(cls, host: str, port: int, token: str | None) -> AccessRules:
        """Return the rules of a server that listens on ``host``."""
        hosts = frozenset({"localhost", "127.0.0.1", "::1", host}) if is_loopback(host) else frozenset()
        return cls(port, token, hosts)

    @property
    def cookie(self) -> str:
        """Return the name of the cookie, which includes the port, because browsers share cookies between the ports of a
        host.
        """
        return f"bestman_bt_monitor_{self.port}"


class Guard:
    """ASGI middleware: refuses requests without access, and adds the security headers of the page."""

    def __init__(self, app: ASGIApp, rules: AccessRules) -> None:
        self._app = app
        self._rules = rules
        # The cookie differs from the token: an attacker who reads a browser's cookies does not learn the token.
        self._session = secrets.token_urlsafe(24)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or connection."""
        if scope["type"] == "websocket":
            await self._websocket(scope, receive, send)
        elif scope["type"] == "http":
            await self._http(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _http(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in HEADERS.items():
                    headers[name] = value
            await send(message)

        refused = self._refusal(scope)
        await (refused or self._app)(scope, receive, guarded)

    def _refusal(self, scope: Scope) -> Response | None:
        headers = Headers(scope=scope)
        if not self._is_our_host(headers):
            return JSONResponse({"error": "this server does not go by that name"}, 403)
        if scope["method"] not in ("GET", "HEAD") and "origin" in headers and not self._is_our_origin(headers):
            return JSONResponse({"error": "no other page may control a run"}, 403)
        if self._is_known(headers):
            return None
        if scope["path"] == "/health":
            return JSONResponse({"service": SERVICE})
        token = parse_qs(scope["query_string"].decode("latin-1")).get("token", [""])[0]
        if scope["path"] == "/" and self._is_token(token):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self._rules.cookie, self._session, httponly=True, samesite="strict", path="/")
            return answer
        return JSONResponse({"error": "open the address that bestman-bt monitor has printed: it holds the token"}, 401)

    async def _websocket(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers = Headers(scope=scope)
        if self._is_our_host(headers) and self._is_known(headers) and self._is_our_origin(headers):
            await self._app(scope, receive, send)
            return
        await receive()
        await send({"type": "websocket.close", "code": FORBIDDEN, "reason": "not allowed"})

    def _is_our_host(self, headers: Headers) -> bool:
        name = _host_name(headers.get("host", ""))
        return bool(name) and (not self._rules.hosts or name in self._rules.hosts)

    def _is_our_origin(self, headers: Headers) -> bool:
        """Return whether a page of this server asks; other clients have to send the server as their origin."""
        try:
            origin = urlsplit(headers.get("origin", ""))
        except ValueError:
            return False
        return origin.scheme in ("http", "https") and origin.netloc.lower() == headers.get("host", "").lower()

    def _is_known(self, headers: Headers) -> bool:
        if self._rules.token is None:
            return True
        scheme, _, credentials = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and self._is_token(credentials.strip()):
            return True
        return any(_equal(value, self._session) for value in _cookies(headers.getlist("cookie"), self._rules.cookie))

    def _is_token(self, text: str) -> bool:
        return self._rules.token is not None and _equal(text, self._rules.token)


def _equal(given: str, secret: str) -> bool:
    """Compare in constant time, which does not reveal where the texts differ."""
    return hmac.compare_digest(given.encode("utf-8", "surrogatepass"), secret.encode())


def _host_name(host: str) -> str:
    try:
        return urlsplit(f"//{host}").hostname or ""
    except ValueError:
        return ""


def _cookies(headers: Iterable[str], name: str) -> list[str]:
    return [cookies[name] for cookies in map(cookie_parser, headers) if name in cookies]
