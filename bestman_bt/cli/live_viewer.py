"""``--live`` of verbs that run something: a Rerun viewer that sees the run while it happens."""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bestman_bt.visualization import ViewerError
from bestman_bt.visualization.rerun import Display, LiveFeed, Viewer, ViewerOptions, has_window_system

START_WAIT = 120.0
"""Seconds within which something is recorded."""
LAST_WORDS = 1.0
"""Seconds in which viewers take what was written last."""


@contextmanager
def shown_live(recording: Path) -> Iterator[None]:
    """Show what is written to ``recording``: in a window, which stays; where none can be opened on a page, to the end.

    A viewer that does not start is told, and no reason to stop.
    """
    window = has_window_system()
    ended = threading.Event()
    with tempfile.TemporaryFile("w+") as output:
        relay = Viewer(ViewerOptions(Display.RELAY if window else Display.BROWSER, fed=True), (), output)

        def open_viewer() -> None:
            try:
                relay.wait_until_up(START_WAIT)
                if window:
                    Viewer(ViewerOptions(Display.WINDOW, source=relay.address), (), output)
                else:
                    print(f"live: {relay.page}", file=sys.stderr, flush=True)
            except ViewerError as error:
                if not ended.is_set():
                    print(f"bestman-bt: --live: {error}", file=sys.stderr, flush=True)

        opening = threading.Thread(target=open_viewer, name="live-viewer", daemon=True)
        opening.start()
        try:
            with LiveFeed(recording, relay.pipe):
                yield
            time.sleep(LAST_WORDS)
        finally:
            ended.set()
            relay.stop()
            opening.join()
