"""Examples: bestman-bt set speed=0.2; bestman-bt set object=cup --run fetch_cup --scope fetch/pick."""

from __future__ import annotations

import json
import sys
from typing import Annotated

import typer

from bestman_bt.cli.chosen_run import RunOption, ask, chosen


def command(
    entry: Annotated[str, typer.Argument(metavar="KEY=VALUE", help="A value is JSON, or else text.")],
    run: RunOption = None,
    scope: Annotated[str, typer.Option(help="The path of a SubTree; the main tree without it.")] = "",
) -> None:
    """Write a blackboard entry of a running execution, also while it is paused."""
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
