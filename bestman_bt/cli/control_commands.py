"""The verbs of running executions: selection of the execution, the request, and the response.

The last lines of a verb's docstring are the examples at the end of its help.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import Json
from bestman_bt.errors import InputError
from bestman_bt.monitor.control_client import ControlError, request, running_executors

Run = Annotated[
    str | None,
    typer.Argument(
        metavar="[RUN]",
        help="Its task, run folder, process id or socket; not needed where only one runs.",
        show_default=False,
    ),
]

RunOption = Annotated[str | None, typer.Option("--run", help="As of status; not needed where only one runs.")]
_NODE_HELP = "A node path as status prints it, or a number."
NodeArgument = Annotated[str, typer.Argument(metavar="NODE", help=_NODE_HELP)]
OptionalNode = Annotated[str | None, typer.Argument(metavar="[NODE]", help=_NODE_HELP, show_default=False)]
Share = Annotated[
    str | None,
    typer.Argument(
        metavar="[SHARE]",
        help="Fraction of the normal speed, 5% to 100%: 30% or 0.3. Without it, the current one is shown.",
        show_default=False,
    ),
]


def status_command(run: Run = None, as_json: Json = False) -> None:
    """Show the state of the running executions: active leaves, parts, the last failure.

    Examples: bestman-bt status; bestman-bt status fetch_cup --json. Exit code 1 if nothing runs.
    """
    running = running_statuses() if run is None else [chosen(run)]
    if as_json:
        print(json.dumps({"runs": [{"socket": str(path), **status} for path, status in running]}))
    elif not running:
        print("nothing is running", file=sys.stderr)
    else:
        for path, status in running:
            print(f"{name_of(path, status)}: {_words(status)}")
    sys.exit(0 if running else 1)


def pause_command(run: Run = None) -> None:
    """Pause a running execution between two ticks.

    Example: bestman-bt pause, or bestman-bt pause fetch_cup if several run.
    """
    path, status = chosen(run)
    answer = ask(path, {"do": "pause"})
    print(f"paused {status['task']} at tick {answer['ticks']}")


def resume_command(run: Run = None) -> None:
    """Resume a paused execution.

    Example: bestman-bt resume, or bestman-bt resume fetch_cup if several run.
    """
    path, status = chosen(run)
    answer = ask(path, {"do": "resume"})
    print(f"resumed {status['task']} at tick {answer['ticks']}")


def step_command(run: Run = None) -> None:
    """Execute one tick of a paused execution, up to its end or a breakpoint.

    Example: bestman-bt step; returns when the tick has ended.
    """
    path, status = chosen(run)
    answer = ask(path, {"do": "step"})
    progress = f"tick {answer['ticks']}, {answer['time']:.2f} s, {answer['root']}{breakpoint_text(answer)}"
    print(f"stepped {status['task']} to {progress}")


def decline_command(run: Run = None) -> None:
    """Refuse the motion that a run with --confirm waits to start.

    Example: bestman-bt decline, for a run with --confirm; bestman-bt resume starts the motion instead.
    """
    path, status = chosen(run)
    ask(path, {"do": "decline"})
    print(f"declined in {status['task']}: {(status['held_at'] or {}).get('words') or 'a motion'}")


def speed_command(share: Share = None, run: Run = None) -> None:
    """Scale the speed of the robot of a running execution, including current motions; 1 is normal speed.

    Examples: bestman-bt speed 30%; bestman-bt speed 1 fetch_cup; bestman-bt speed (shows the current scale).
    """
    wanted = None if share is None else _share_of(share)
    path, status = chosen(run)
    if wanted is not None:
        status = {**status, **ask(path, {"do": "speed", "share": wanted})}
    print(f"{status['task']} runs at {status['speed']:.0%} of its speed")


def break_command(
    node: NodeArgument,
    run: RunOption = None,
    after: Annotated[bool, typer.Option("--after", help="Wait after the node's tick, not before.")] = False,
    moment: Annotated[str, typer.Option("--when", metavar="before|after", hidden=True)] = "",
    condition: Annotated[
        str | None, typer.Option("--if", metavar="SCRIPT", help="Wait at the first tick at which it holds.")
    ] = None,
    once: Annotated[bool, typer.Option("--once", help="Clear it when it is reached.")] = False,
) -> None:
    """Set a breakpoint: a running execution waits at a node; continue with step or resume.

    Examples: bestman-bt break fetch/pick/grasp; bestman-bt break grasp --after --if "attempts > 2" --run fetch_cup.
    """
    when = moment or ("after" if after else "before")
    if when not in ("before", "after") or (after and when == "before"):
        message = f"waits before the node's tick, or with --after behind it, got '{moment}'"
        raise typer.BadParameter(message, param_hint="--when")
    path, status = chosen(run)
    asked = {"node": node_of(node), "when": when, "condition": condition, "once": once}
    answer = ask(path, {"do": "breakpoint", **asked})
    made = next(one for one in answer["breakpoints"] if node in (one["path"], str(one["node"])) and one["when"] == when)
    print(f"{status['task']} waits {when} {made['path']}{f' if {condition}' if condition else ''}")


def unbreak_command(
    node: OptionalNode = None,
    run: RunOption = None,
    everything: Annotated[bool, typer.Option("--all", help="Clear all breakpoints.")] = False,
) -> None:
    """Clear the breakpoints before and after a node, or all. A waiting execution remains paused.

    Examples: bestman-bt unbreak fetch/pick/grasp; bestman-bt unbreak --all.
    """
    if (node is None) != everything:
        raise typer.BadParameter("give a node, or --all", param_hint="NODE")
    path, status = chosen(run)
    before = len(status["breakpoints"])
    answer = ask(path, {"do": "clear_breakpoint", "node": None if node is None else node_of(node)})
    left = answer["breakpoints"]
    remaining = ", ".join(f"{one['when']} {one['path']}" for one in left)
    print(f"cleared {before - len(left)} in {status['task']}; left: {remaining or 'none'}")


def set_command(
    entry: Annotated[str, typer.Argument(metavar="KEY=VALUE", help="A value is JSON, or else text.")],
    run: RunOption = None,
    scope: Annotated[str, typer.Option(help="The path of a SubTree; the main tree without it.")] = "",
) -> None:
    """Write a blackboard entry of a running execution, also while it is paused.

    Examples: bestman-bt set speed=0.2; bestman-bt set object=cup --run fetch_cup --scope fetch/pick.
    """
    key, equals, text = entry.partition("=")
    if not key.strip() or not equals:
        raise typer.BadParameter(f"should be KEY=VALUE, got '{entry}'", param_hint="KEY=VALUE")
    path, status = chosen(run)
    try:
        value = json.loads(text)
    except ValueError:
        value = text
    answer = ask(path, {"do": "set", "key": key.strip(), "value": value, "scope": scope})
    print(f"set {key.strip()} = {json.dumps(value, ensure_ascii=False)} in {status['task']}")
    if "note" in answer:
        print(f"note: {answer['note']}", file=sys.stderr)


def stop_command(
    run: Run = None,
    everything: Annotated[bool, typer.Option("--all", help="All of them, as without RUN.")] = False,
) -> None:
    """Stop the robot of one run, or of all runs of this user.

    Stops executors of this user through their control sockets; exit code 1 if one did not respond.
    """
    if run is not None and everything:
        raise typer.BadParameter("one run or --all, not both", param_hint="RUN")
    executors = running_executors() if run is None else [chosen(run)[0]]
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


def node_of(text: str) -> int | str:
    """Return a node as requests name it: by its number, or by its path."""
    return int(text) if text.isdecimal() else text


def running_statuses() -> list[tuple[Path, dict[str, Any]]]:
    """Return the socket and status of each running executor; executors that do not respond are reported and skipped."""
    found = []
    for path in running_executors():
        try:
            found.append((path, request(path, {"do": "status"})))
        except ControlError as error:
            print(f"bestman-bt: {path.name}: {error}", file=sys.stderr)
    return found


def chosen(run: str | None) -> tuple[Path, dict[str, Any]]:
    """Return the execution that ``run`` names, or the only one. Exits with code 1 if none runs, else raises
    InputError.
    """
    running = running_statuses()
    if not running:
        print("nothing is running", file=sys.stderr)
        sys.exit(1)
    named = running if run is None else [one for one in running if _is_named(run, *one)]
    if len(named) == 1:
        return named[0]
    choices = "\n".join(f"  {name_of(path, status)}" for path, status in running)
    which = f"{len(named)} running executions are named {run!r}" if named else f"no running execution is named {run!r}"
    which = "several executions run" if run is None else which
    raise InputError(f"{which}; name one of these by process id or run folder:\n{choices}")


def ask(path: Path, message: dict[str, Any]) -> dict[str, Any]:
    """Return the answer to a request; a refusal is printed and ends the program with exit code 1."""
    try:
        return request(path, message)
    except ControlError as error:
        print(f"bestman-bt: {error}", file=sys.stderr)
        sys.exit(1)


def name_of(path: Path, status: dict[str, Any]) -> str:
    """Return task, process and run folder in the form that other commands accept."""
    folder = f", {status['folder']}" if status.get("folder") else ""
    return f"{status['task']} (process {status['pid']}{folder})"


def breakpoint_text(status: dict[str, Any]) -> str:
    """Return ``, before fetch/pick`` if a run waits at a breakpoint, else an empty text."""
    held_at = status["held_at"]
    return f", {held_at['when']} {held_at['node']}" if held_at is not None and held_at["node"] is not None else ""


def _is_named(run: str, path: Path, status: dict[str, Any]) -> bool:
    """Return whether ``run`` names an execution; its folder may be given relative to the working directory."""
    names = {path.name, path.stem, str(path), str(status["pid"]), status["task"]}
    if status.get("folder"):
        folder = Path(status["folder"])
        if run == folder.name or Path(run).resolve() == folder.resolve():
            return True
    return run in names


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


def _share_of(text: str) -> float:
    try:
        share = float(text.removesuffix("%")) / (100.0 if text.endswith("%") else 1.0)
    except ValueError:
        share = float("nan")
    if not 0.0 < share <= 1.0:
        raise InputError(f"SHARE is {text!r}, but a speed is 5% to 100%, as 30% or 0.3")
    return share
