"""Examples: bestman-bt speed 30%; bestman-bt speed 1 fetch_cup; bestman-bt speed (shows the current scale)."""

from __future__ import annotations

from typing import Annotated

import typer

from bestman_bt.cli.chosen_run import Run, ask, chosen
from bestman_bt.errors import InputError

Share = Annotated[
    str | None,
    typer.Argument(
        metavar="[SHARE]",
        help="Fraction of the normal speed, 5% to 100%: 30% or 0.3. Without it, the current one is shown.",
        show_default=False,
    ),
]


def command(share: Share = None, run: Run = None) -> None:
    """Scale the speed of the robot of a running execution, including motions under way; 1 is normal speed."""
    wanted = None if share is None else _share_of(share)
    path, status = chosen(run)
    if wanted is not None:
        status = {**status, **ask(path, {"do": "speed", "share": wanted})}
    print(f"{status['task']} runs at {status['speed']:.0%} of its speed")


def _share_of(text: str) -> float:
    try:
        share = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        share = float("nan")
    if not 0.0 < share <= 1.0:
        raise InputError(f"SHARE is {text!r}, but a speed is 5% to 100%, as 30% or 0.3")
    return share
