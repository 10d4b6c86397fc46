"""Example: bestman-bt resume, or bestman-bt resume fetch_cup where several run."""

from __future__ import annotations

from bestman_bt.cli.chosen_run import Run, ask, chosen


def command(run: Run = None) -> None:
    """Resume a paused execution."""
    path, status = chosen(run)
    answer = ask(path, {"do": "resume"})
    print(f"resumed {status['task']} at tick {answer['ticks']}")
