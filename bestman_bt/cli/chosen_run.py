"""Selects the running execution of a command, and sends requests to it."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.errors import InputError
from bestman_bt.monitor.control_client import ControlError, request, running_executors

Run = Annotated[
    str | None,
    typer.Argument(
        metavar="[RUN]",
        help="Its task, run folder, process id or socket; not needed where only one runs.",
        show_default=False,
    ),
]

RunOption = Annotated[str | None, typer.Option("--run", help="As of status; not needed where only one runs.")]
_NODE_HELP = "A node path as status prints it, or a number."
NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help=_NODE_HELP)]
OptionalNode = Annotated[str | None, typer.Argument(metavar="[NODE]", help=_NODE_HELP, show_default=False)]


def node_of(text: str) -> int | str:
    """Return a node as requests name it: by its number, or by its path."""
    return int(text) if text.isdecimal() else text


def running_statuses() -> list[tuple[Path, dict[str, Any]]]:
    """Return the socket and status of each running executor; one that does not answer is reported and left out."""
    found = []
    for path in running_executors():
        try:
            found.append((path, request(path, {"do": "status"})))
        except ControlError as error:
            print(f"bestman-bt: {path.name}: {error}", file=sys.stderr)
    return found


def chosen(run: str | None) -> tuple[Path, dict[str, Any]]:
    """Return the execution that ``run`` names, or the only one. Exits with code 1 if none runs, else raises
    InputError.
    """
    running = running_statuses()
    if not running:
        print("nothing is running", file=sys.stderr)
        sys.exit(1)
    named = running if run is None else [one for one in running if _is_named(run, *one)]
    if len(named) == 1:
        return named[0]
    choices = "\n".join(f"  {name_of(path, status)}" for path, status in running)
    which = f"{len(named)} running executions are named {run!r}" if named else f"no running execution is named {run!r}"
    which = "several executions run" if run is None else which
    raise InputError(f"{which}; name one of these by process id or run folder:\n{choices}")


def ask(path: Path, message: dict[str, Any]) -> dict[str, Any]:
    """Return the answer to a request; a refusal is printed and ends the program with exit code 1."""
    try:
        return request(path, message)
    except ControlError as error:
        print(f"bestman-bt: {error}", file=sys.stderr)
        sys.exit(1)


def name_of(path: Path, status: dict[str, Any]) -> str:
    """Return task, process and run folder in the form that other commands accept."""
    folder = f", {status['folder']}" if status.get("folder") else ""
    return f"{status['task']} (process {status['pid']}{folder})"


def breakpoint_text(status: dict[str, Any]) -> str:
    """Return ``, before fetch/pick`` if a run waits at a breakpoint, else an empty text."""
    held_at = status["held_at"]
    return f", {held_at['when']} {held_at['node']}" if held_at is not None and held_at["node"] is not None else ""


def _is_named(run: str, path: Path, status: dict[str, Any]) -> bool:
    """Return whether ``run`` names an execution; its folder may be told from the working directory."""
    names = {path.name, path.stem, str(path), str(status["pid"]), status["task"]}
    if status.get("folder"):
        folder = Path(status["folder"])
        if run == folder.name or Path(run).resolve() == folder.resolve():
            return True
    return run in names
