"""Examples: bestman-bt export runs/<run> --format chrome -o trace.json; bestman-bt export log.btlog --format jsonl."""

from __future__ import annotations

import sqlite3
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import writable_file, wrong_input


class Format(StrEnum):
    """The format of the exported file."""

    SQLITE = "sqlite"
    CHROME = "chrome"
    JSONL = "jsonl"


def command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run folder, or a .btlog or .db3 file.")],
    form: Annotated[
        Format,
        typer.Option(
            "--format",
            help="sqlite: tables of BehaviorTree.CPP's SqliteLogger, a session is added to a file that is there; "
            "chrome: a trace for ui.perfetto.dev; jsonl: a JSON object a line.",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="The file.", callback=writable_file)],
) -> None:
    """Write the state changes of a recorded run for other tools."""
    from bestman_bt.records.export import FORMATS
    from bestman_bt.records.reader import read

    history = read(run, skip=("blackboard", "image", "map", "path", "robot", "scan"))
    if not len(history.nodes):
        raise wrong_input(str(run), f"does not describe a tree: {'; '.join(history.faults)}")
    try:
        FORMATS[form](history, out)
    except (OSError, sqlite3.Error) as error:
        raise wrong_input(str(out), f"cannot be written: {error}") from error
    for fault in history.faults:
        print(f"bestman-bt: {run}: {fault}", file=sys.stderr)
    print(out)
