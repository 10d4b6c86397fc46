"""``--monitor`` of verbs that run something: the monitor that serves already, or a new one in a process of its own."""

from __future__ import annotations

import json
import selectors
import subprocess
import sys
from urllib.error import URLError
from urllib.request import ProxyHandler, build_opener

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.monitor.control_client import socket_folder

IDLE_END = 600
"""Seconds after which a monitor that was started so ends, once nothing runs and no page is open."""
START_WAIT = 60.0
HEALTH_WAIT = 2.0
LARGEST_ANSWER = 10_000


def show_in_monitor(port: int) -> None:
    """Print the address of a monitor, starting one where none serves; raises ConfigurationError where that fails."""
    address = f"http://127.0.0.1:{port}/"
    if not _serves(address):
        address = _start(port)
    print(f"monitor: {address}", file=sys.stderr, flush=True)


def _serves(address: str) -> bool:
    """Whether a monitor answers there that sees our executors."""
    opener = build_opener(ProxyHandler({}))
    try:
        with opener.open(f"{address}health", timeout=HEALTH_WAIT) as answer:
            told = json.loads(answer.read(LARGEST_ANSWER))
    except (URLError, OSError, ValueError):
        return False
    expected = {"service": "bestman-bt monitor", "sockets": str(socket_folder())}
    return isinstance(told, dict) and told.items() >= expected.items()


def _start(port: int) -> str:
    """Start a monitor that outlives this process; its address."""
    verb = ["monitor", "--port", str(port), "--no-browser", "--end-when-idle", str(IDLE_END)]
    process = subprocess.Popen(
        [sys.executable, "-m", "bestman_bt.cli.main", *verb],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,  # Ctrl-C ends the run, not the page that shows how it ended
    )
    assert process.stdout is not None
    with process.stdout as output, selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        line = output.readline().decode(errors="replace").strip() if selector.select(START_WAIT) else ""
    told, _, address = line.partition(" ")
    if told != "monitor:":
        process.terminate()
        why = line.removeprefix("bestman-bt: ") or f"it does not answer within {START_WAIT:g} s"
        raise ConfigurationError([Problem("--monitor", None, "", f"the monitor does not start: {why}")])
    return address
