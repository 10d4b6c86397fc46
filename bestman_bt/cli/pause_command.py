"""Example: bestman-bt pause, or bestman-bt pause fetch_cup where several run."""

from __future__ import annotations

from bestman_bt.cli.chosen_run import Run, ask, chosen


def command(run: Run = None) -> None:
    """Pause a running execution between two ticks."""
    path, status = chosen(run)
    answer = ask(path, {"do": "pause"})
    print(f"paused {status['task']} at tick {answer['ticks']}")
