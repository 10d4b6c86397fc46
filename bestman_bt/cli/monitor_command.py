"""Examples: bestman-bt monitor; bestman-bt monitor runs/ --read-only; bestman-bt monitor --connect
groot2://127.0.0.1:1667.
"""

from __future__ import annotations

import ipaddress
import signal
import socket
import sys
import webbrowser
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bestman_bt.cli.options import MONITOR_PORT, grouped_options, refuse_unwritable_folder, wrong_input
from bestman_bt.monitor.control_client import TOKEN_VARIABLE, page_address

if TYPE_CHECKING:
    from bestman_bt.monitor.groot2.watcher import Groot2Watcher


@dataclass(frozen=True)
class Connections:
    """External processes to watch."""

    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="groot2://HOST:PORT",
            help="Watch and record a process of BehaviorTree.CPP 4 with a Groot2Publisher; may be given several times.",
        ),
    ] = None
    runs: Annotated[Path, typer.Option(help="Folder in which --connect creates run folders.")] = Path("runs")
    states_only: Annotated[
        bool,
        typer.Option(
            "--states-only",
            help="Read the states of processes 20 times a second; do not let them record each change, which can end "
            "a process of BehaviorTree.CPP 4.9 or older that changes thousands of states a second.",
        ),
    ] = False

    def watchers(self) -> list[Groot2Watcher]:
        """Return one watcher for each process, not started."""
        if not self.connect:
            if self.states_only:
                raise wrong_input("--states-only", "applies only to processes watched with --connect")
            return []
        from bestman_bt.monitor.groot2.client import parse_address
        from bestman_bt.monitor.groot2.protocol import Groot2Error
        from bestman_bt.monitor.groot2.watcher import Groot2Watcher

        try:
            places = [parse_address(address) for address in dict.fromkeys(self.connect)]
        except Groot2Error as error:
            raise wrong_input("--connect", str(error)) from error
        refuse_unwritable_folder(self.runs, "--runs")
        return [Groot2Watcher(*place, self.runs, every_change=not self.states_only) for place in places]


@grouped_options
def command(
    folders: Annotated[
        list[Path] | None,
        typer.Argument(metavar="[RUN]...", help="Run folders, folders that hold some, .btlog and .db3 files."),
    ] = None,
    others: Connections = Connections(),
    port: Annotated[int, typer.Option(min=0, max=65535, help="0 for any free one.")] = MONITOR_PORT,
    host: Annotated[str, typer.Option(help="Address to listen on; any but loopback demands a token.")] = "127.0.0.1",
    token: Annotated[
        str | None,
        typer.Option(
            help="The token to demand; made up where --host needs one.",
            show_default=False,
            envvar=TOKEN_VARIABLE,
        ),
    ] = None,
    read_only: Annotated[bool, typer.Option("--read-only", help="Show only: no pause, stop, set, breakpoint.")] = False,
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Only print the address.")] = False,
    end_when_idle: Annotated[
        float | None,
        typer.Option(min=1.0, metavar="SECONDS", help="End after this long without any executor and page."),
    ] = None,
) -> None:
    """Show running executors, and recorded runs, in the browser."""
    from bestman_bt.monitor.recorded import identity_of
    from bestman_bt.monitor.security import SHORTEST_TOKEN, is_loopback, new_token
    from bestman_bt.monitor.server import MonitorServer, ServerConfig, bind

    recorded = _recorded(folders or ())
    if token is not None and len(token) < SHORTEST_TOKEN:
        raise wrong_input(
            "--token", f"a token should have at least {SHORTEST_TOKEN} characters, so that it cannot be guessed"
        )
    if token is None and not is_loopback(host):
        token = new_token()
    watchers = others.watchers()
    try:
        listening = bind(host, port)
    except OSError as error:
        raise wrong_input(f"--host {host} --port {port}", f"cannot listen there: {error.strerror or error}") from error
    port = listening.getsockname()[1]
    config = ServerConfig(host, port, token, read_only, tuple(folders or ()), end_when_idle)
    address = page_address(socket.gethostname() if _is_any(host) else host, port, token)
    if len(recorded) in (1, 2):  # the page opens one at once, or two side by side
        address += "#" + "&".join(identity_of(folder) for folder in recorded)

    def started() -> None:
        for watcher in watchers:
            watcher.start()
        print(f"monitor: {address}", flush=True)
        if not no_browser and is_loopback(host):
            webbrowser.open(address)

    if watchers:  # the server ends in order and then gives the signal again, which must not keep them from their end
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    try:
        MonitorServer(config).run(listening, started)
    finally:
        for watcher in watchers:
            watcher.stop()
    sys.exit(0)


def _recorded(given: Iterable[Path]) -> list[Path]:
    from bestman_bt.records.reader import run_folders

    found: list[Path] = []
    for path in given:
        those = run_folders(path)
        if not those:
            raise wrong_input(str(path), "is not a run folder or log, and contains none")
        found += those
    return found


def _is_any(host: str) -> bool:
    """Return whether it means all addresses of this machine, so that a browser cannot open it."""
    try:
        return ipaddress.ip_address(host).is_unspecified
    except ValueError:
        return False
