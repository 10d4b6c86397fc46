"""Reaches every executor of this user through its control socket; exit code 1 where one did not obey."""

from __future__ import annotations

import sys

from bestman_bt.monitor.control_client import ControlError, request, running_executors


def command() -> None:
    """Stop the robots of all running executors."""
    executors = running_executors()
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
