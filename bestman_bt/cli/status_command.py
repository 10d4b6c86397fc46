"""Examples: bestman-bt status; bestman-bt status fetch_cup --json. Exit code 1 where nothing runs."""

from __future__ import annotations

import json
import sys
from typing import Any

from bestman_bt.cli.chosen_run import Run, breakpoint_text, chosen, name_of, running_statuses
from bestman_bt.cli.options import Json


def command(run: Run = None, as_json: Json = False) -> None:
    """Show the state of the running executions: active leaves, parts, the last failure."""
    running = running_statuses() if run is None else [chosen(run)]
    if as_json:
        print(json.dumps({"runs": [{"socket": str(path), **status} for path, status in running]}))
    elif not running:
        print("nothing is running", file=sys.stderr)
    else:
        for path, status in running:
            print(f"{name_of(path, status)}: {_words(status)}")
    sys.exit(0 if running else 1)


def _words(status: dict[str, Any]) -> str:
    """Return the status as several lines."""
    state = f"paused{breakpoint_text(status)}" if status["paused"] else "running"
    state += "" if status["speed"] == 1.0 else f" at {status['speed']:.0%} of its speed"
    lines = [f"{state}, tick {status['ticks']}, {status['time']:.2f} s"]
    lines += [f"  active: {path}" for path in status["active"]]
    parts = ", ".join(f"{name} {state}" for name, state in status["parts"].items())
    lines += [f"  parts: {parts}"] if parts else []
    failure = status["last_failure"]
    if failure is not None:
        lines.append(
            f"  last failure: {failure['where'] or failure['node']}: {failure['error_code']}: {failure['why']}"
        )
    return "\n".join(lines)
