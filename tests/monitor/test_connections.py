"""Connections that ask for nothing leave the stop button alone."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack

import httpx
import pytest

from tests.monitor.conftest import FakeExecutor

pytestmark = [pytest.mark.slow, pytest.mark.real_time]

DESCRIPTORS, ATTACKERS = 256, 300
BEGUN = {
    "nothing sent": b"",
    "header begun": b"POST /api/runs/4242-abc/stop HTTP/1.1\r\nHost: 127.0.0.1\r\n",
    "body begun": b"POST /api/runs/4242-abc/pause HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 500\r\n\r\n{",
    "page begun": b"GET /ws HTTP/1.1\r\nHost: 127.0.0.1:%d\r\nOrigin: http://127.0.0.1:%d\r\nUpgrade: websocket\r\n"
    b"Connection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n",
}


@pytest.fixture
def port() -> Iterator[int]:
    """Of a monitor that may have few file descriptors."""
    words = [sys.executable, "-m", "bestman_bt.cli.main", "monitor", "--no-browser", "--port", "0"]
    limited = ["sh", "-c", f'ulimit -n {DESCRIPTORS}; exec "$@"', "sh", *words]
    process = subprocess.Popen(limited, stdout=subprocess.PIPE, text=True, env=os.environ)
    try:
        assert process.stdout is not None
        found = re.search(r":(\d+)/", process.stdout.readline())
        assert found is not None
        yield int(found[1])
    finally:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


@pytest.mark.parametrize("begun", BEGUN.values(), ids=BEGUN.keys())
def test_a_stop_comes_in_however_many_connections_are_half_open(
    executor: FakeExecutor, port: int, begun: bytes
) -> None:
    begun = begun % (port, port) if b"%d" in begun else begun
    with ExitStack() as stack:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=20.0) as http:
            while not http.get("/api/runs").json()["runs"]:
                time.sleep(0.05)
        for _ in range(ATTACKERS):
            attacker = stack.enter_context(socket.create_connection(("127.0.0.1", port), timeout=20.0))
            attacker.sendall(begun)
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", trust_env=False, timeout=5.0) as http:
            answer = http.post("/api/runs/4242-abc/stop")
    assert (answer.status_code, answer.json()["ok"]) == (200, True)
    assert executor.asked[-1] == {"do": "stop"}
