"""The command line. Verbs are imported on use, so that light commands start quickly."""

from __future__ import annotations

import inspect
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperGroup

from bestman_bt.errors import InputError

VERBS = {
    "demo": "fetch a cup in simulation and show what happened",
    "run": "run a tree or a task once and judge it",
    "plan": "plan for a goal given as text or facts, make a tree of the plan and check it",
    "eval": "run a task over many seeds and summarise",
    "sweep": "run the same seeds with several settings and compare",
    "collect": "record judged successes of a task, failures apart, as datasets for learning",
    "dataset": "describe, show, merge and replay datasets of episodes",
    "compare": "compare two evaluations seed by seed",
    "look": "show what the robot perceives of the furniture in a scene",
    "cloud": "show, thin, clean, convert and draw a cloud of points",
    "domain": "show what task planners may order, and write it as PDDL",
    "show": "print a tree, or the trees of a folder",
    "convert": "write a tree file of BehaviorTree.CPP 3 as version 4",
    "diff": "show the differences between two tree files, as text and as a picture",
    "stub": "write Python skeletons of the leaves that have no code here",
    "simulate": "run a tree in simulated time with simulated leaves, and report its coverage",
    "nodes": "list the nodes that trees may use, with their ports",
    "validate": "check tree files without running them",
    "map": "show a map: free, occupied and unknown space",
    "object": "add, list and show objects",
    "robots": "list robots and the parts that they are made of",
    "robot": "show, check and import robots and their parts",
    "calibrate": "calibrate a lens, a camera on an arm or on a head, from views of a board",
    "twin": "emulate a robot's controllers over a simulated world, in real time",
    "monitor": "show running executors, and recorded runs, in the browser",
    "report": "write a report of a run, or of several",
    "explain": "show why a run failed: obstacle, last pose tried, image",
    "export": "write the state changes of a recorded run for other tools",
    "render": "make pictures and a film of a simulated run that has ended",
    "replay": "open what runs recorded in the Rerun viewer",
    "status": "show the state of the running executions",
    "pause": "pause a running execution between two ticks",
    "resume": "continue a paused execution",
    "step": "run one tick of a paused execution",
    "decline": "refuse the motion that a run with --confirm waits to start",
    "speed": "set the speed of the robot in a running execution",
    "break": "pause a running execution at a node",
    "unbreak": "clear breakpoints of a running execution",
    "set": "write a blackboard entry of a running execution",
    "stop": "stop the robots of one or all running executors",
    "version": "print the versions of this package and of its dependencies",
}

NUMBERS = {"int": "whole number", "int range": "whole number", "float": "number", "float range": "number"}
"""Typer's name of an option type → the name shown to users."""

CONTROLS = ("status", "pause", "resume", "step", "decline", "speed", "break", "unbreak", "set", "stop")
"""Verbs of running executions."""

STARTING = (
    *("demo", "run", "plan", "eval", "sweep", "collect", "look"),
    *("twin", "monitor", "render", "replay", "robot", "calibrate"),
)
"""Verbs that start something: for invalid input, they report that nothing was started."""


class Verbs(TyperGroup):
    """Imports a verb when it is used: ``bestman_bt.cli.<verb>_command:command`` (or ``verbs``, a group), and those of
    running executions from ``bestman_bt.cli.control_commands:<verb>_command``.
    """

    def list_commands(self, ctx: Any) -> list[str]:
        """Return all verbs, in the order of use."""
        return list(VERBS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Import the verb's module; for a misspelt verb, the closest one is suggested."""
        if cmd_name not in VERBS:
            from bestman_bt.registry import suggestion

            ctx.fail(f"unknown command {cmd_name!r}; {suggestion(cmd_name, list(VERBS))}")
        if cmd_name in CONTROLS:
            command = getattr(import_module("bestman_bt.cli.control_commands"), f"{cmd_name}_command")
            examples: str | None = inspect.cleandoc(command.__doc__).partition("\n\n")[2]
        else:
            module = import_module(f"bestman_bt.cli.{cmd_name}_command")
            if hasattr(module, "verbs"):
                return _in_plain_words(typer.main.get_command(module.verbs))
            command, examples = module.command, module.__doc__
        verb = typer.Typer(add_completion=False, rich_markup_mode=None)
        verb.command(name=cmd_name, help=VERBS[cmd_name].capitalize() + ".", epilog=examples)(command)
        return _in_plain_words(typer.main.get_command(verb))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """List the verbs without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(list(VERBS.items()))


def _in_plain_words(command: Any) -> Any:
    """Return the command, whose numbers are not called ``int range`` in help and faults; a missing RUN names the
    latest.
    """
    for inner in getattr(command, "commands", {}).values():
        _in_plain_words(inner)
    for parameter in command.params:
        parameter.type.name = NUMBERS.get(parameter.type.name, parameter.type.name)
        if str(parameter.metavar).startswith("RUN"):
            parameter.type.get_missing_message = _latest_runs
    return command


def _latest_runs(*_: Any, **__: Any) -> str:
    """Return a sentence that names the latest run folders, the newest first."""
    found = sorted(Path("runs").glob("*/config.yaml"), key=lambda file: file.stat().st_mtime, reverse=True)
    latest = ", ".join(str(file.parent) for file in found[:3])
    return f"The latest {'run is' if len(found) == 1 else 'runs are'} {latest}" if found else "There is none below runs"


app = typer.Typer(
    cls=Verbs,
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Behavior-tree task execution for mobile manipulators.",
)


@app.callback()
def root() -> None:
    """Behavior-tree task execution for mobile manipulators."""


def main() -> None:
    """Run the command line. Exit codes: 0 success, 1 failure, 2 invalid input (nothing started), 130 cancelled."""
    # Products of small arrays are slower on several threads, and their last bits depend on how many there are.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of files need not be text
    verb = next((argument for argument in sys.argv[1:] if argument in VERBS), "")
    with input_errors(starts=verb in STARTING):
        app(prog_name="bestman-bt")


@contextmanager
def input_errors(starts: bool) -> Iterator[None]:
    """Convert the errors of invalid input to a message and exit code 2. ``starts``: whether the verb starts something;
    the message then states that nothing was started.
    """
    try:
        yield
    except InputError as error:
        print(f"bestman-bt: {_message(error, starts)}", file=sys.stderr)
        sys.exit(2)


def _message(error: InputError, starts: bool) -> str:
    count = len(getattr(error, "problems", (error,)))
    nothing = "nothing was started" if starts else ""
    if count > 1:
        return f"{count} errors{', ' if nothing else ''}{nothing}:\n{error}"
    return f"{nothing}: {error}" if nothing else str(error)


if __name__ == "__main__":
    main()
