"""The monitor's server: the page, its WebSocket, and pictures; one process for all runs of this machine."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import resource
import socket
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.protocols.http.h11_impl import H11Protocol

from bestman_bt.monitor.control_client import SERVICE, socket_folder
from bestman_bt.monitor.controls import CONTROLS, UnknownControlError, check_fields, control
from bestman_bt.monitor.run import RunError
from bestman_bt.monitor.run_list import RunList
from bestman_bt.monitor.security import AccessRules, Guard
from bestman_bt.monitor.viewer import Viewer

STATIC = Path(__file__).parent / "static"
LARGEST_REQUEST = 64 << 10
"""Bytes of one message from a page."""
MOST_VIEWERS = 32
PING_PERIOD = 20.0
"""Ping period, seconds; a page that does not answer for another period counts as gone."""
IDLE_PERIOD = 5.0
BODY_TIME = 5.0
"""Time limit for the body of a request, seconds."""
BACKLOG = 128
"""Number of connections queued by the operating system."""
_LOG = logging.getLogger(__name__)


@dataclass(frozen=True)
class ServerConfig:
    """A ``host`` other than loopback requires a ``token``. ``end_when_idle``: seconds without executor and page."""

    host: str = "127.0.0.1"
    port: int = 8750
    token: str | None = None
    read_only: bool = False
    folders: tuple[Path, ...] = ()
    end_when_idle: float | None = None


class _Site:
    """The responses to requests, and the number of open pages."""

    def __init__(self, config: ServerConfig, runs: RunList) -> None:
        self.config, self.runs = config, runs
        self.viewers = 0

    @contextlib.asynccontextmanager
    async def lifespan(self, _: Starlette) -> AsyncIterator[None]:
        """Start and stop the runs with the application."""
        await self.runs.start()
        try:
            yield
        finally:
            await self.runs.stop()

    async def health(self, _: Request) -> Response:
        """Identify this server."""
        return JSONResponse({"service": SERVICE, "sockets": str(socket_folder()), "read_only": self.config.read_only})

    async def page(self, _: Request) -> Response:
        """Return the page itself."""
        index = STATIC / "index.html"
        if not index.is_file():
            return _error("this installation has no built page: bestman_bt/monitor/static is empty", 404)
        return FileResponse(index, headers={"Cache-Control": "no-cache"})

    async def image(self, request: Request) -> Response:
        """Return a picture of a run."""
        run = self.runs.get(request.path_params["identity"])
        if run is None:
            return _error("there is no such run; GET /api/runs lists them", 404)
        try:
            content = await run.picture(request.path_params["number"])
        except RunError as error:
            return _error(str(error), 404)
        kind = "image/png" if content.startswith(b"\x89PNG") else "image/jpeg"
        return Response(content, media_type=kind, headers={"Cache-Control": "private, max-age=3600"})

    async def list_runs(self, _: Request) -> Response:
        """Return all runs, newest first."""
        return JSONResponse({"runs": self.runs.summaries()})

    async def control_run(self, request: Request) -> Response:
        """Forward a request to a running execution."""
        run, what = self.runs.get(request.path_params["identity"]), request.path_params.get("control", "status")
        if run is None:
            return _error("there is no such run; GET /api/runs lists them", 404)
        if request.method == "GET" and what in CONTROLS and "control" in request.path_params:
            return _error(f"{what} needs a POST request", 405, {"Allow": "POST"})
        if self.config.read_only and what != "status":
            return _error("this monitor is read-only", 403)
        try:
            asked = await _asked(request)
            if what in CONTROLS:
                check_fields(what, asked)
            return JSONResponse(await control(run, {**asked, "do": what}))
        except UnknownControlError as error:
            return _error(str(error), 404)
        except RunError as error:
            return _error(str(error), 409)

    async def refused(self, _: Request, error: Exception) -> Response:
        """Return an error as JSON."""
        assert isinstance(error, HTTPException)
        return _error(error.detail, error.status_code, error.headers)

    async def viewer(self, websocket: WebSocket) -> None:
        """Serve an open page."""
        await websocket.accept()
        if self.viewers >= MOST_VIEWERS:
            await websocket.close(1013, f"{MOST_VIEWERS} pages are open already")
            return
        self.viewers += 1
        try:
            await Viewer(self.runs, websocket.send_text, websocket.receive_text, self.config.read_only).run()
        except WebSocketDisconnect:
            _LOG.debug("a page has disconnected")
        except KeyError:  # a binary message, which no page sends
            await websocket.close(1003, "texts only")
        finally:
            self.viewers -= 1


def make_app(config: ServerConfig, runs: RunList) -> ASGIApp:
    """Return the application; ``runs`` is started and stopped with it."""
    site = _Site(config, runs)
    routes = [
        Route("/health", site.health),
        Route("/", site.page),
        Route("/runs/{identity}/images/{number:int}.jpg", site.image),
        Route("/api/runs", site.list_runs),
        Route("/api/runs/{identity}", site.control_run),
        Route("/api/runs/{identity}/{control}", site.control_run, methods=["GET", "POST"]),
        WebSocketRoute("/ws", site.viewer),
        Mount("/", StaticFiles(directory=STATIC, check_dir=False)),
    ]
    app = Starlette(routes=routes, lifespan=site.lifespan, exception_handlers={HTTPException: site.refused})
    return Guard(app, AccessRules.of(config.host, config.port, config.token))


def _error(text: str, status: int, headers: Mapping[str, str] | None = None) -> Response:
    return JSONResponse({"error": text}, status, headers)


async def _asked(request: Request) -> dict[str, Any]:
    """Return the JSON object of a request, empty without a body; raises RunError. No foreign page can send JSON
    unasked.
    """
    content = b""
    try:
        async with asyncio.timeout(BODY_TIME):
            async for piece in request.stream():
                content += piece
                if len(content) > LARGEST_REQUEST:
                    raise RunError(f"a request has at most {LARGEST_REQUEST} bytes")
    except TimeoutError as error:
        raise RunError(f"the request's body did not arrive within {BODY_TIME:g} s") from error
    if not content:
        return {}
    if request.headers.get("content-type", "").partition(";")[0].strip() != "application/json":
        raise RunError("a request should be JSON, with Content-Type: application/json")
    try:
        asked = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise RunError(f"a request should be one JSON object: {error}") from error
    if not isinstance(asked, dict):
        raise RunError("a request should be one JSON object")
    return asked


class MonitorServer:
    """The HTTP server. ``socket`` is already bound, so that a port in use is reported before the start."""

    def __init__(self, config: ServerConfig) -> None:
        self.config = config
        self.runs = RunList(config.folders)
        self._server = uvicorn.Server(
            uvicorn.Config(
                make_app(config, self.runs),
                lifespan="on",
                http=BoundedProtocol,
                backlog=BACKLOG,
                log_level="warning",
                access_log=False,
                server_header=False,
                ws="websockets-sansio",
                ws_max_size=LARGEST_REQUEST,
                ws_ping_interval=PING_PERIOD,
                ws_ping_timeout=PING_PERIOD,
                ws_per_message_deflate=not AccessRules.of(config.host, config.port, None).hosts,
                timeout_graceful_shutdown=1,
            )
        )

    def run(self, listening: socket.socket, started: Callable[[], None] | None = None) -> None:
        """Serve in this thread until ``end`` is called or a signal arrives."""

        async def serve() -> None:
            serving = asyncio.create_task(self._server.serve([listening]))
            while not self._server.started and not serving.done():
                await asyncio.sleep(0.01)
            if started is not None and self._server.started:
                started()
            watching = asyncio.create_task(self._end_when_idle())
            await serving
            watching.cancel()

        asyncio.run(serve())

    def end(self) -> None:
        """Make ``run`` return; thread-safe."""
        self._server.should_exit = True

    async def _end_when_idle(self) -> None:
        idle, limit = 0.0, self.config.end_when_idle
        while limit is not None and idle < limit:
            await asyncio.sleep(IDLE_PERIOD)
            idle = idle + IDLE_PERIOD if self.runs.is_idle else 0.0
        if limit is not None:
            self.end()


def bind(host: str, port: int) -> socket.socket:
    """Bind the address. Raises OSError if the port is taken or the host is not one of this machine."""
    family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(BACKLOG)
    except OSError:
        listening.close()
        raise
    return listening


# Connections to the monitor: a bounded number, each with a short time for its request, so that a stop always gets in.
# Half-open connections, which send no request, do not keep out the others.


HEADER_TIME = 5.0
"""Time limit from the connection to the first request, seconds."""
MOST_CONNECTIONS = 256
RESERVED = 96
"""File descriptors reserved for files and for the sockets of executors."""


def most_connections() -> int:
    """Return the largest number of connections; smaller if the process may open few file descriptors."""
    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    return MOST_CONNECTIONS if soft == resource.RLIM_INFINITY else max(16, min(MOST_CONNECTIONS, soft - RESERVED))


class BoundedProtocol(H11Protocol):
    """HTTP/1.1 connections of a bounded number: at the limit, the one that has waited longest is closed.

    An answer takes milliseconds, so the oldest connection sends no request or does not read. Pages stay connected:
    their WebSockets have separate protocols.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # asyncio calls it with a socket's transport
        """Start the deadline for the request."""
        self._overdue = self.loop.call_later(HEADER_TIME, transport.abort)
        if len(self.connections) >= most_connections():
            waiting = (other for other in self.connections if isinstance(other, BoundedProtocol))
            oldest = min(waiting, key=lambda other: other._overdue.when(), default=None)
            if oldest is not None:
                self.connections.discard(oldest)
                oldest.transport.abort()
        super().connection_made(transport)

    def data_received(self, data: bytes) -> None:
        """End the deadline: the request has arrived. Between requests uvicorn's timeout applies."""
        super().data_received(data)
        if self.cycle is not None:
            self._overdue.cancel()

    def handle_websocket_upgrade(self, *arguments: Any) -> None:
        """Start to ping the page."""
        self._overdue.cancel()
        super().handle_websocket_upgrade(*arguments)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop to ping the page."""
        self._overdue.cancel()
        super().connection_lost(exc)
