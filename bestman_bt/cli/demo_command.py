"""Runs fetch_cup with a recording and pictures, and writes its report; the folder that it names holds all of them."""

from __future__ import annotations

import sys
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.options import MONITOR_PORT, Groot2Port, Json, Live, Monitor, MonitorPort, Seed, json_output
from bestman_bt.cli.report_command import REPORT_NAME
from bestman_bt.cli.run_command import ViewOptions, execute, exit_code
from bestman_bt.cli.run_view import RESULTS
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration.run import load_run
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.report.page import report_page
from bestman_bt.evaluation.report.run_reader import read_run_report

DEMO_SEED = 7


def command(
    seed: Seed = DEMO_SEED,
    runs: Annotated[Path, typer.Option(help="Folder in which the run folder is created.")] = Path("runs"),
    monitor: Monitor = False,
    monitor_port: MonitorPort = MONITOR_PORT,
    groot2_port: Groot2Port = None,
    live: Live = False,
    as_json: Json = False,
) -> None:
    """Fetch a cup in simulation and show what happened."""
    with json_output(as_json) as print_json:
        setup = prepare_episode(load_run("fetch_cup", seed=seed, record=True))
        if monitor:
            show_in_monitor(monitor_port)
        result, folder = execute(setup, runs, ViewOptions(pictures=True, groot2_port=groot2_port, live=live))
        report = folder / REPORT_NAME
        report.write_text(report_page([read_run_report(folder)], datetime.now()), encoding="utf-8")
        _what_next(folder, report)
        print_json(result.to_document())
    sys.exit(exit_code(result))


def _what_next(folder: Path, report: Path) -> None:
    program = sys.argv[0] if not Path(sys.argv[0]).is_absolute() else "bestman-bt"
    lines = {
        "what happened, on one page": f"{report}, to be opened in a browser",
        "such a page of any run": f"{program} report RUN",
        "the run again, step by step": f"{program} monitor",
        "pictures of it": f"{program} render {folder}",
        "another task": f"{program} run fetch_from_drawer",
        "write your own tree": "docs/writing_a_tree.md",
    }
    RESULTS.print("\nWhat to type next", style="bold")
    for what, how in lines.items():
        RESULTS.print(f"  {what:<29}{how}", highlight=False, markup=False, soft_wrap=True)
