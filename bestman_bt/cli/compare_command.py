"""Examples: bestman-bt compare runs/evaluations/A runs/evaluations/B; bestman-bt compare FOLDER:ENTRY FOLDER:OTHER."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import Json, json_output, writable_file


def _writable_picture(path: Path | None) -> Path | None:
    if path is not None and path.suffix.lower() not in (".png", ".svg"):
        raise typer.BadParameter(f"pictures are PNG or SVG files, got '{path}'")
    return writable_file(path)


def command(
    first: Annotated[str, typer.Argument(metavar="A", help="The folder of an evaluation, or FOLDER:ENTRY.")],
    second: Annotated[str, typer.Argument(metavar="B", help="The evaluation to compare it with, seed by seed.")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", metavar="FILE", help="A picture, PNG or SVG.", callback=_writable_picture),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare two evaluations seed by seed."""
    from bestman_bt.configuration.errors import ProblemCollector
    from bestman_bt.evaluation.comparison import matched
    from bestman_bt.evaluation.finished_evaluation import read_entries

    with json_output(as_json) as print_json:
        faults, sides = ProblemCollector(), []
        for side in (first, second):
            with faults.step():
                sides.append(read_entries(side))
        faults.raise_if_any()
        compared = matched(sides[0], sides[1], (first, second))
        if out is not None:
            for number, one in enumerate(compared, 1):
                one.draw(out if len(compared) == 1 else out.with_stem(f"{out.stem}_{number}"))
        print_json({"comparisons": [one.document() for one in compared]})
    if not as_json:
        for one in compared:
            print("\n".join(one.lines()))
