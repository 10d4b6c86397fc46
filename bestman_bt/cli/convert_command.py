"""Example: bestman-bt convert old.xml -o new.xml. Notes for manual review go to standard error."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import writable_file
from bestman_bt.engine.models.conversion import convert
from bestman_bt.engine.xml.document import XmlDocument, canonical
from bestman_bt.engine.xml.documents import read_file


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE.xml", help="A tree file of BehaviorTree.CPP 3 or 4.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE.xml", help="By default it is printed.", callback=writable_file),
    ] = None,
    normalized: Annotated[
        bool, typer.Option("--canonical", help="Indented, with double quotes, as UTF-8; else white space stays.")
    ] = False,
) -> None:
    """Write a tree file as version 4 and as XML; a file that is already both is copied byte for byte."""
    converted = convert(read_file(file, str(file)), str(file))
    data = converted.data
    if normalized:
        data = canonical(XmlDocument.parse(data, str(file))).encode("utf-8")
    if output is not None:
        output.write_bytes(data)
        print(output)
    else:
        sys.stdout.flush()
        sys.stdout.buffer.write(data)
    for line, words in converted.notes:
        print(f"{file}:{line}: {words}", file=sys.stderr)
