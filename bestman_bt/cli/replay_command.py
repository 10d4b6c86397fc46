"""Examples: bestman-bt replay runs/20261122-101500-fetch_cup-7; bestman-bt replay RUN OTHER_RUN --browser."""

from __future__ import annotations

import signal
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import typer

from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.visualization.errors import RecordingError, ViewerError
from bestman_bt.visualization.rerun.recorder import RECORDING_NAME
from bestman_bt.visualization.rerun.viewer import (
    Display,
    RerunViewer,
    ViewerOptions,
    check_recording,
    has_window_system,
)


def command(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="Run folders made with --record, or .rrd files.")],
    browser: Annotated[
        bool, typer.Option("--browser", help="Serve a page instead of opening a window, until Ctrl-C.")
    ] = False,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="With --browser: the port of the page.")] = None,
) -> None:
    """Open the recordings of runs in the Rerun viewer: robot, scene, cameras, tree and joints on one timeline."""
    recordings = [_recording(run) for run in runs]
    display = Display.BROWSER if browser else Display.WINDOW
    if display is Display.WINDOW and not has_window_system():
        message = "no window can be opened: DISPLAY is not set; --browser serves a page instead"
        raise ConfigurationError([Problem("bestman-bt replay", None, "", message)])
    for number in (signal.SIGTERM, signal.SIGHUP):  # the viewer is in a session of its own and would stay
        signal.signal(number, signal.default_int_handler)
    with tempfile.TemporaryFile("w+") as output:
        try:
            viewer = RerunViewer(ViewerOptions(display, page_port=port), recordings, output)
        except ViewerError as error:
            raise ConfigurationError([Problem("bestman-bt replay", None, "", str(error))]) from error
        try:
            if display is Display.BROWSER:
                print(viewer.page, flush=True)
            code = viewer.wait()
        except KeyboardInterrupt:
            code = 0
        finally:
            viewer.stop()
        if code != 0:
            print(f"bestman-bt: the viewer stopped with code {code}: {viewer.output()}", file=sys.stderr)
    sys.exit(1 if code else 0)


def _recording(run: Path) -> Path:
    """Return the recording of a run folder, or the file itself, once it has been found to be one."""
    path = run / RECORDING_NAME if run.is_dir() else run
    if not path.is_file():
        message = "there is no such run folder or file"
        if run.is_dir():
            message = (
                f"has no {RECORDING_NAME}; simulated runs with --record have one, bestman-bt monitor shows the others"
            )
        raise ConfigurationError([Problem(str(run), None, "", message)])
    try:
        check_recording(path)
    except RecordingError as error:
        raise ConfigurationError([Problem(str(path), None, "", str(error))]) from error
    return path
