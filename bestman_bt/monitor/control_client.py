"""The client of the control channel: finds running executors and sends requests to them."""

from __future__ import annotations

import contextlib
import json
import socket
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

from bestman_bt.errors import Error
from bestman_bt.runtime_folder import runtime_folder

SERVICE = "bestman-bt monitor"
"""The answer of ``/health``, without a token."""
TOKEN_VARIABLE = "BESTMAN_BT_MONITOR_TOKEN"
"""Environment variable of the token: a token on the command line would be visible to all users of the machine."""


def page_address(host: str, port: int, token: str | None) -> str:
    """Return the address that opens the page."""
    query = f"?token={quote(token, safe='')}" if token else ""
    return f"http://{f'[{host}]' if ':' in host else host}:{port}/{query}"


LONGEST_ANSWER = 1 << 20


class ControlError(Error):
    """A control channel cannot be reached or has refused a request."""


def socket_folder() -> Path:
    """Return the folder of the sockets of this user's executors (mode 0700)."""
    try:
        return runtime_folder()
    except PermissionError as error:
        raise ControlError(str(error)) from error


def link_folder(path: Path, run_folder: Path) -> None:
    """Link ``control.sock`` in a run folder to an executor's socket, and the socket's name with ``.folder`` back."""
    path.with_suffix(".folder").symlink_to(run_folder.absolute())
    link = run_folder / "control.sock"
    link.unlink(missing_ok=True)  # of an executor that was killed
    link.symlink_to(path)


def remove_socket(path: Path) -> None:
    """Remove an executor's socket and both links, also of a process that was killed."""
    back = path.with_suffix(".folder")
    with contextlib.suppress(OSError):
        link = back / "control.sock"
        if link.readlink() == path:
            link.unlink()
    back.unlink(missing_ok=True)
    path.unlink(missing_ok=True)


def running_executors() -> list[Path]:
    """Return the sockets of the running executors; sockets without a server, and links to them, are removed."""
    alive = []
    for path in sorted(socket_folder().glob("*.sock")):
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(1.0)
            try:
                connection.connect(str(path))
            except (ConnectionRefusedError, FileNotFoundError):
                remove_socket(path)
                continue
            except OSError:  # it has a server, which is too busy to answer now
                pass
        alive.append(path)
    return alive


def request(path: Path, message: dict[str, Any], timeout: float = 5.0) -> dict[str, Any]:
    """Send one request to an executor and return its answer; raises ControlError."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(timeout)
            connection.connect(str(path.resolve()))
            connection.sendall(json.dumps(message).encode() + b"\n")
            line = connection.makefile("rb").readline(LONGEST_ANSWER)
        answer: dict[str, Any] = json.loads(line)
    except (OSError, ValueError) as error:
        raise ControlError(f"no executor answers at {path}: {error}") from error
    if not answer.get("ok"):
        raise ControlError(str(answer.get("error", "refused")))
    return answer


def ask_events(path: Path, topics: Iterable[str]) -> Iterator[bytes]:
    """Subscribe to an executor and yield each event as a line, until the executor ends. Raises OSError."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.connect(str(path))
        connection.sendall(json.dumps({"do": "subscribe", "topics": list(topics)}).encode() + b"\n")
        with connection.makefile("rb") as lines:
            lines.readline()  # the answer
            yield from lines
