"""Examples: bestman-bt unbreak fetch/pick/grasp; bestman-bt unbreak --all."""

from __future__ import annotations

from typing import Annotated

import typer

from bestman_bt.cli.chosen_run import OptionalNode, RunOption, ask, chosen, node_of


def command(
    node: OptionalNode = None,
    run: RunOption = None,
    everything: Annotated[bool, typer.Option("--all", help="Clear all breakpoints.")] = False,
) -> None:
    """Clear the breakpoints before and after a node, or all. A waiting execution remains paused."""
    if (node is None) != everything:
        raise typer.BadParameter("give a node, or --all", param_hint="NODE")
    path, status = chosen(run)
    before = len(status["breakpoints"])
    answer = ask(path, {"do": "clear_breakpoint", "node": None if node is None else node_of(node)})
    left = answer["breakpoints"]
    remaining = ", ".join(f"{one['when']} {one['path']}" for one in left)
    print(f"cleared {before - len(left)} in {status['task']}; left: {remaining or 'none'}")
