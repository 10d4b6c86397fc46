"""Run folders: ``runs/<time>-<task>-<seed>/``."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

from bestman_bt.configuration import ConfigurationError, Problem, RunConfig, dump_run


def make_run_folder(config: RunConfig, parent: Path = Path("runs")) -> Path:
    """Make the folder of a run, with its ``config.yaml``; a number is added where the name is taken.

    Raises ConfigurationError where ``parent`` cannot hold it.
    """
    stem = f"{datetime.now().strftime('%Y%m%d-%H%M%S')}-{config.name}-{config.seed}"
    folder = parent / stem
    number = 1
    while True:
        try:
            folder.mkdir(parents=True)
            break
        except FileExistsError:
            number += 1
            folder = parent / f"{stem}-{number}"
        except OSError as error:
            message = f"no run folder can be made there: {error.strerror}"
            raise ConfigurationError([Problem(f"--runs {parent}", None, "", message)]) from error
    (folder / "config.yaml").write_text(dump_run(config, absolute=True), encoding="utf-8")
    return folder
