"""``--live`` of verbs that run something: a Rerun viewer that sees the run while it happens."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.visualization import ViewerError
from bestman_bt.visualization.rerun import Display, Viewer, ViewerParameters, has_window_system


@contextmanager
def live_viewer() -> Iterator[str]:
    """The address of a viewer: a window, which stays; where none can be opened a page, served until the context ends.

    ConfigurationError where it does not start.
    """
    display = Display.WINDOW if has_window_system() else Display.BROWSER
    with tempfile.TemporaryFile("w+") as output:
        try:
            viewer = Viewer(ViewerParameters(display), (), output)
        except ViewerError as error:
            raise ConfigurationError([Problem("--live", None, "", str(error))]) from error
        if display is Display.BROWSER:
            print(f"live: {viewer.page}", file=sys.stderr, flush=True)
        try:
            yield viewer.address
        finally:
            if display is Display.BROWSER:
                viewer.stop()
