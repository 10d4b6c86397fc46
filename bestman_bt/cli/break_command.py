"""Examples: bestman-bt break fetch/pick/grasp; bestman-bt break grasp --after --if "attempts > 2" --run fetch_cup."""

from __future__ import annotations

from typing import Annotated

import typer

from bestman_bt.cli.chosen_run import NodeArgument, RunOption, ask, chosen, node_of


def command(
    node: NodeArgument,
    run: RunOption = None,
    after: Annotated[bool, typer.Option("--after", help="Wait after the node's tick, not before.")] = False,
    moment: Annotated[str, typer.Option("--when", metavar="before|after", hidden=True)] = "",
    condition: Annotated[
        str | None, typer.Option("--if", metavar="SCRIPT", help="Wait at the first tick at which it holds.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Clear it when it is reached.")] = False,
) -> None:
    """Set a breakpoint: a running execution waits at a node; continue with step or resume."""
    when = moment or ("after" if after else "before")
    if when not in ("before", "after") or (after and when == "before"):
        message = f"waits before the node's tick, or with --after behind it, got '{moment}'"
        raise typer.BadParameter(message, param_hint="--when")
    path, status = chosen(run)
    asked = {"node": node_of(node), "when": when, "condition": condition, "once": once}
    answer = ask(path, {"do": "breakpoint", **asked})
    made = next(one for one in answer["breakpoints"] if node in (one["path"], str(one["node"])) and one["when"] == when)
    print(f"{status['task']} waits {when} {made['path']}{f' if {condition}' if condition else ''}")
