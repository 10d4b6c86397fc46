"""Stops executors of this user through their control sockets; exit code 1 if one did not obey."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from bestman_bt.cli.chosen_run import Run, chosen
from bestman_bt.monitor.control_client import ControlError, request, running_executors


def command(
    run: Run = None,
    everything: Annotated[bool, typer.Option("--all", help="All of them, as without RUN.")] = False,
) -> None:
    """Stop the robot of one run, or of all that this user runs."""
    if run is not None and everything:
        raise typer.BadParameter("one run or --all, not both", param_hint="RUN")
    executors = running_executors() if run is None else [chosen(run)[0]]
    if not executors:
        print("nothing is running")
    failed = False
    for path in executors:
        try:
            answer = request(path, {"do": "stop"})
        except ControlError as error:
            print(f"{path.name}: {error}", file=sys.stderr)
            failed = True
        else:
            print(f"stopped {answer['task']} (process {answer['pid']}, tick {answer['ticks']})")
    sys.exit(1 if failed else 0)
