"""Examples: bestman-bt explain runs/<run>; bestman-bt explain runs/<run> --json."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.options import Json, json_output
from bestman_bt.errors import InputError
from bestman_bt.evaluation.result import RunResult
from bestman_bt.records.events import LogEvent
from bestman_bt.records.history import RunHistory
from bestman_bt.records.reader import has_record, read, read_result
from bestman_bt.records.writer import EVENTS_FILE, RESULT_FILE

MOST = 20
"""Largest number of failures to print."""
LEFT_OUT = ("blackboard", "map", "path", "robot", "scan", "states")
"""Events without information about failures."""
SCENE = "scene"


def command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    as_json: Json = False,
) -> None:
    """Print why a run failed: leaf, code, stage, colliding bodies or joint at its limit, the last pose tried, and the
    image.

    Failures from which the tree recovered are also listed.
    """
    with json_output(as_json) as write:
        document = _explanation(run)
        write(document)
        if not as_json:
            print(*_in_words(document), sep="\n")


def _explanation(run: Path) -> dict[str, Any]:
    if not run.is_dir():
        raise InputError(f"{run} is not a folder")
    try:
        result = RunResult.from_document(document) if (document := read_result(run)) else None
    except (InputError, ValueError) as error:
        raise InputError(f"{run / RESULT_FILE} is not a result of a run: {error}") from error
    if result is None and not has_record(run):
        raise InputError(f"{run} is not a run folder: it has neither {RESULT_FILE} nor {EVENTS_FILE}")
    history = read(run, LEFT_OUT) if has_record(run) else RunHistory()
    logged = [line for _, line in history.log if line.node and line.level == "warning"]
    on_the_way = [_document(run, history, line) for line in logged[-MOST:]]
    failure = result.failure if result is not None else None
    fatal = None
    if failure is not None:
        same = [one for one in on_the_way if (one["node"], one["code"]) == (failure.named, failure.error_code)]
        seen = same[-1] if same else {"time": None, "picture": None}
        fatal = {
            "time": seen["time"],
            "node": failure.named or "the run",
            "code": failure.error_code,
            "why": failure.why,
            "obstacle": failure.obstacle and asdict(failure.obstacle),
            "picture": seen["picture"],
        }
    named = run.name if result is None else f"{result.task}, seed {result.seed}"
    outcome = "interrupted" if result is None else str(result.outcome)
    return {"run": named, "outcome": outcome, "failure": fatal, "on_the_way": on_the_way}


def _document(run: Path, history: RunHistory, line: LogEvent) -> dict[str, Any]:
    """Return a failure as JSON, with the image taken when its node failed."""
    of_it = (SCENE, line.node, line.time)
    pictures = [one.file for one in history.pictures if (one.camera, one.node, one.time) == of_it]
    return {
        "time": line.time,
        "node": line.where or line.node,
        "code": line.code,
        "why": line.message,
        "obstacle": line.obstacle and asdict(line.obstacle),
        "picture": str(run / pictures[-1]) if pictures and pictures[-1] else None,
    }


def _in_words(document: dict[str, Any]) -> Iterator[str]:
    failure, on_the_way = document["failure"], document["on_the_way"]
    yield f"{document['run']}: {document['outcome']}"
    if failure is not None:
        yield from _failure_lines(failure)
    others = [one for one in on_the_way if failure is None or one["why"] != failure["why"]]
    if others:
        yield f"failures on the way, the last {len(others)}:"
    for one in others:
        yield from _failure_lines(one)
    if failure is None and not others:
        yield "nothing failed"


def _failure_lines(failure: dict[str, Any]) -> Iterator[str]:
    time = "" if failure["time"] is None else f" at {failure['time']:.2f} s"
    yield f"  {failure['node']}{time}: {failure['code']}"
    yield f"    why         {failure['why']}"
    obstacle = failure["obstacle"] or {}
    if obstacle:
        yield f"    stage       {obstacle['stage']}"
    for one, other in obstacle.get("pairs", ()):
        yield f"    in the way  {one} with {other}"
    if obstacle.get("joint"):
        yield f"    joint       {obstacle['joint']}, off by {obstacle['beyond']:.3f}"
    elif obstacle.get("beyond") is not None:
        yield f"    out of reach by {obstacle['beyond']:.3f} m"
    if obstacle.get("positions"):
        yield "    last tried  " + ", ".join(f"{name} {value:.3f}" for name, value in obstacle["positions"].items())
    if failure["picture"]:
        yield f"    picture     {failure['picture']}"
