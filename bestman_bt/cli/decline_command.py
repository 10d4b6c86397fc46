"""Example: bestman-bt decline; of a run with --confirm. bestman-bt resume starts the motion."""

from __future__ import annotations

from bestman_bt.cli.chosen_run import Run, ask, chosen


def command(run: Run = None) -> None:
    """Refuse the motion that a run with --confirm waits to start."""
    path, status = chosen(run)
    ask(path, {"do": "decline"})
    print(f"declined in {status['task']}: {(status['held_at'] or {}).get('words') or 'a motion'}")
