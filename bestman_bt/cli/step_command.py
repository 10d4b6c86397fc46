"""Example: bestman-bt step; answers once the tick is done."""

from __future__ import annotations

from bestman_bt.cli.chosen_run import Run, ask, breakpoint_text, chosen


def command(run: Run = None) -> None:
    """Execute one tick of a paused execution, up to its end or a breakpoint."""
    path, status = chosen(run)
    answer = ask(path, {"do": "step"})
    progress = f"tick {answer['ticks']}, {answer['time']:.2f} s, {answer['root']}{breakpoint_text(answer)}"
    print(f"stepped {status['task']} to {progress}")
