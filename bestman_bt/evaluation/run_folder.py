"""Run folders: ``runs/<time>-<task>-<seed>/``, and folders named by a program."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.run import RunConfig, dump_run
from bestman_bt.records.writer import CONFIG_FILE, EVENTS_FILE, LOG_FILE, RESULT_FILE, STATES_FILE, make_folder


def make_run_folder(config: RunConfig, parent: Path = Path("runs")) -> Path:
    """Create the folder of a run with its ``config.yaml``; an existing name gets a number.

    Raises ConfigurationError if ``parent`` is not usable.
    """
    stem = f"{datetime.now():%Y%m%d-%H%M%S}-{config.name}-{config.seed}"
    try:
        folder = make_folder(parent, stem)
        (folder / CONFIG_FILE).write_text(dump_run(config, absolute=True), encoding="utf-8")
    except OSError as error:
        message = f"no run folder can be made there: {error.strerror}"
        raise ConfigurationError([Problem(f"--runs {parent}", None, "", message)]) from error
    return folder


def claim_run_folder(folder: Path) -> None:
    """Create the folder that a program names for one run. Raises ConfigurationError if it holds a run already."""
    there = [name for name in (RESULT_FILE, STATES_FILE, EVENTS_FILE, LOG_FILE) if (folder / name).exists()]
    message = f"holds a run already ({', '.join(there)}); name another folder, one for each run"
    if not there:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            return
        except OSError as error:
            message = f"no run folder can be made there: {error.strerror}"
    raise ConfigurationError([Problem(f"folder={str(folder)!r}", None, "", message)])
