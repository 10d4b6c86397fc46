"""Runs fetch_cup with a recording and pictures; the folder that it names holds all of them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.cli.json_output import json_output
from bestman_bt.cli.options import MONITOR_PORT, Groot2Port, Json, Live, Monitor, MonitorPort, Seed
from bestman_bt.cli.run_command import execute, exit_code
from bestman_bt.cli.started_monitor import show_in_monitor
from bestman_bt.configuration import load_run
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.extras import is_installed

DEMO_SEED = 7


def command(
    seed: Seed = DEMO_SEED,
    runs: Annotated[Path, typer.Option(help="Where the run folder is made.")] = Path("runs"),
    monitor: Monitor = False,
    monitor_port: MonitorPort = MONITOR_PORT,
    groot2_port: Groot2Port = None,
    live: Live = False,
    as_json: Json = False,
) -> None:
    """Fetch a cup in simulation and show what happened."""
    with json_output(as_json) as tell:
        setup = prepare_episode(load_run("fetch_cup", seed=seed, record=is_installed("rerun")))
        if monitor:
            show_in_monitor(monitor_port)
        result = execute(setup, runs, pictures=True, groot2_port=groot2_port, live=live)
        tell(result.to_document())
    sys.exit(exit_code(result))
