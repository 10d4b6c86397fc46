"""Examples: bestman-bt report runs/<run>; bestman-bt report runs/evaluations/manipulation -o all.html."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import writable_file

REPORT_NAME = "report.html"


def _writable_html(path: Path | None) -> Path | None:
    """Check, before the work begins, that the page can be written."""
    if path is None:
        return None
    if path.suffix.lower() not in (".html", ".htm"):
        raise typer.BadParameter(f"reports are HTML files: FILE.html, got '{path}'")
    writable_file(path)
    return path


def command(
    runs: Annotated[
        list[Path], typer.Argument(metavar="RUN", help="Run folders, folders that hold some, .btlog and .db3 files.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE.html",
            help="The page; report.html in the folder of a single run, else here.",
            callback=_writable_html,
        ),
    ] = None,
) -> None:
    """Write an HTML report of one run, or a summary of several."""
    from bestman_bt.evaluation.report.page import report_page
    from bestman_bt.evaluation.report.run_reader import ReportError, folders_to_report, read_run_report

    stories, faults = [], []
    folders = list(dict.fromkeys(folder.resolve() for given in runs for folder in folders_to_report(given)))
    for folder in folders:
        try:
            stories.append(read_run_report(folder))
        except ReportError as error:
            faults.append(error)
    if not stories:
        raise ReportError("\n".join(map(str, faults)))
    if out is None:
        out = folders[0] / REPORT_NAME if len(folders) == 1 and folders[0].is_dir() else Path(REPORT_NAME)
    page = report_page(stories, datetime.now())
    try:
        out.write_text(page, encoding="utf-8")
    except OSError as error:
        raise ReportError(f"{out} cannot be written: {error.strerror or error}") from error
    for fault in faults:
        print(f"bestman-bt: left out: {fault}", file=sys.stderr)
    for story in stories:
        for note in story.notes:
            print(f"bestman-bt: {story.folder}: {note}", file=sys.stderr)
    print(out)
