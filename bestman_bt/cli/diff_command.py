"""Example: bestman-bt diff old.xml new.xml --svg diff.svg. Exit code 0 if the files are equal, 1 if they differ."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Json, json_output, writable_file
from bestman_bt.configuration.data import find_data, shipped_trees
from bestman_bt.engine import TreeLoadError, TreeProblem
from bestman_bt.engine.models.difference import compare, difference_svg, differences
from bestman_bt.engine.xml.documents import Documents, read_documents


def command(
    before: Annotated[str, typer.Argument(metavar="OLD", help="A shipped tree or an XML file.")],
    after: Annotated[str, typer.Argument(metavar="NEW", help="Another one.")],
    svg: Annotated[
        Path | None,
        typer.Option(metavar="FILE.svg", help="Write one picture of all that differs.", callback=writable_file),
    ] = None,
    json: Json = False,
) -> None:
    """Show the differences between two tree files: nodes added, removed or moved, and changed ports."""
    with json_output(json) as print_json:
        old, new = _read(before), _read(after)
        trees = compare(old, new)
        found = differences(trees)
        if svg is not None:
            svg.write_text(difference_svg(trees, f"{before} → {after}"), encoding="utf-8")
        if not json:
            _print(before, after, [(one.tree, str(one)) for one in found])
        print_json({"before": before, "after": after, "differences": [asdict(one) for one in found]})
    sys.exit(1 if found else 0)


def _read(name: str) -> Documents:
    path = find_data("tree", name)
    if path.suffix == ".py":
        raise typer.BadParameter(f"{name} is a Python file; compare its text")
    documents = read_documents(path, shipped_trees())
    if not documents.trees:
        nothing = TreeProblem(str(path), 1, "root", "", "the file holds no <BehaviorTree>")
        raise TreeLoadError(documents.problems or [nothing])
    return documents


def _print(before: str, after: str, found: list[tuple[str, str]]) -> None:
    print(f"--- {before}\n+++ {after}")
    tree = None
    for name, line in found:
        if name != tree:
            print(name)
            tree = name
        print(f"  {line}")
    if not found:
        print("no difference")
