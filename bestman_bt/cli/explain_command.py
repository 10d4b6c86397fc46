"""Examples: bestman-bt explain runs/<run>; bestman-bt explain runs/<run> --json."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.options import Json
from bestman_bt.engine.logs.segmented_file import read_regular, read_segments
from bestman_bt.errors import InputError

MOST = 20
"""Failures that are told."""
MOST_BYTES = 64_000_000
"""Of a log or a result that are read."""
SCENE = "scene"


def command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")],
    as_json: Json = False,
) -> None:
    """Print why a run failed: leaf, code, stage, bodies or joint in the way, the pose tried last, and the picture.

    Failures that the tree went on after are told, too.
    """
    with json_output(as_json) as write:
        document = _explanation(run)
        write(document)
        if not as_json:
            print(*_in_words(document), sep="\n")


def _explanation(run: Path) -> dict[str, Any]:
    if not run.is_dir():
        raise InputError(f"{run} is not a folder")
    result = _result(run / "result.json")
    logged = [line for line in _lines(run, "log.jsonl") if line.get("node") and line.get("level") == "warning"]
    if not result and not (run / "log.jsonl").is_file():
        raise InputError(f"{run} is not a run folder: it has neither result.json nor log.jsonl")
    pictures = {
        (line.get("node"), line.get("time")): str(run / line["file"])
        for line in _lines(run, "events.jsonl", '"image"')
        if line.get("camera") == SCENE and line.get("file")
    }
    on_the_way = [
        {
            "time": line.get("time"),
            "node": line.get("where") or line["node"],
            "code": line.get("code", ""),
            "why": line.get("event", ""),
            "obstacle": line.get("obstacle"),
            "picture": pictures.get((line["node"], line.get("time"))),
        }
        for line in logged[-MOST:]
    ]
    failure = result.get("failure")
    fatal = None
    if failure:
        named = failure.get("where") or failure.get("node") or "the run"
        same = [one for one in on_the_way if one["node"] == named and one["code"] == failure.get("error_code")]
        fatal = {
            "time": same[-1]["time"] if same else None,
            "node": named,
            "code": failure.get("error_code", ""),
            "why": failure.get("why", ""),
            "obstacle": failure.get("obstacle"),
            "picture": same[-1]["picture"] if same else None,
        }
    outcome = result.get("outcome", "interrupted")
    named = f"{result['task']}, seed {result['seed']}" if result else run.name
    return {"run": named, "outcome": outcome, "failure": fatal, "on_the_way": on_the_way}


def _result(path: Path) -> dict[str, Any]:
    """What ``result.json`` holds; nothing of a run that has not come to its end."""
    if not path.is_file():
        return {}
    try:
        document = json.loads(read_regular(path, MOST_BYTES))
        document["task"], document["seed"]  # every result has them
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} is not a result of a run: {error}") from error
    found: dict[str, Any] = document
    return found


def _lines(run: Path, name: str, with_text: str = "") -> Iterator[dict[str, Any]]:
    """The lines of a log in segments; a torn one is left out."""
    if not (run / name).is_file():
        return
    for segment in read_segments(run / name, MOST_BYTES, MOST_BYTES):
        for line in segment.data.splitlines():
            if with_text.encode() in line:
                try:
                    yield json.loads(line)
                except ValueError:
                    continue


def _in_words(document: dict[str, Any]) -> Iterator[str]:
    failure, on_the_way = document["failure"], document["on_the_way"]
    yield f"{document['run']}: {document['outcome']}"
    if failure is not None:
        yield from _told(failure)
    others = [one for one in on_the_way if failure is None or one["why"] != failure["why"]]
    if others:
        yield f"failures on the way, the last {len(others)}:"
    for one in others:
        yield from _told(one)
    if failure is None and not others:
        yield "nothing failed"


def _told(failure: dict[str, Any]) -> Iterator[str]:
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
