"""``--monitor`` of verbs that run something: the running monitor, or a new one in a separate process."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
from typing import Any
from urllib.error import URLError
from urllib.request import ProxyHandler, Request, build_opener

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.monitor.control_client import SERVICE, TOKEN_VARIABLE, page_address, socket_folder

IDLE_END = 600
"""Seconds after which a monitor started in this way exits if nothing runs and no page is open."""
START_WAIT = 60.0
HEALTH_WAIT = 2.0
LARGEST_ANSWER = 10_000


def show_in_monitor(port: int) -> None:
    """Print the address of a monitor; starts one if none serves. Raises ConfigurationError if that fails."""
    token = os.environ.get(TOKEN_VARIABLE) or None
    address = _address_of_running(port, token)
    if address is None:
        try:
            address = _start(port)
        except ConfigurationError:
            address = _address_of_running(port, token)  # started meanwhile, by another run that began with this one
            if address is None:
                raise
    print(f"monitor: {address}", file=sys.stderr, flush=True)


def _address_of_running(port: int, token: str | None) -> str | None:
    """Return the address of the monitor that serves at a port, or None. Raises ConfigurationError for one of others."""
    served = _health(port, token)
    if served.get("service") != SERVICE:
        return None
    if "sockets" not in served:
        raise _wrong(
            f"the monitor at port {port} demands another token: set {TOKEN_VARIABLE} to its own, or --monitor-port"
        )
    if served["sockets"] != str(socket_folder()):
        raise _wrong(f"the monitor at port {port} serves another user: choose another --monitor-port")
    return page_address("127.0.0.1", port, token)


def _health(port: int, token: str | None) -> dict[str, Any]:
    """Return the health report of the monitor at this address; empty without a monitor."""
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    asked = Request(page_address("127.0.0.1", port, None) + "health", headers=headers)  # noqa: S310 - http always
    try:
        with build_opener(ProxyHandler({})).open(asked, timeout=HEALTH_WAIT) as answer:
            reply = json.loads(answer.read(LARGEST_ANSWER))
    except (URLError, OSError, ValueError):
        return {}
    return reply if isinstance(reply, dict) else {}


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
    reply, _, address = line.partition(" ")
    if reply != "monitor:":
        process.terminate()
        why = line.rpartition(f"--port {port}: ")[2].removeprefix("bestman-bt: nothing was started: ")
        why = why or f"it does not answer within {START_WAIT:g} s"
        raise _wrong(f"the monitor does not start on port {port}: {why}; --monitor-port chooses another")
    return address


def _wrong(message: str) -> ConfigurationError:
    return ConfigurationError([Problem("--monitor", None, "", message)])
