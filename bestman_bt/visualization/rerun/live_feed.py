"""Hands a recording on to a viewer while it is written.

The recorder writes to a file and knows nothing of the viewer: one that is slow or frozen holds up the thread here, and
no tick. Streaming to it directly would do that: Rerun's streams wait for a receiver that is some hundred MB behind.
"""

from __future__ import annotations

import contextlib
import threading
from pathlib import Path
from types import TracebackType
from typing import IO

POLL = 0.1
CHUNK = 1 << 20
LAST_WORDS = 2.0
"""Seconds that the viewer gets at the end to take what is still to be told."""


class LiveFeed:
    """Copies what is appended to ``file``, which may not be there yet, to ``pipe``; between ``open`` and ``close``."""

    def __init__(self, file: Path, pipe: IO[bytes]) -> None:
        self._file = file
        self._pipe = pipe
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._copy, name="live-feed", daemon=True)

    def __enter__(self) -> LiveFeed:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        self._thread.join(LAST_WORDS)

    def _copy(self) -> None:
        while not self._file.exists() and not self._done.wait(POLL):
            pass
        # Until the viewer is closed; or nothing was recorded.
        with contextlib.suppress(OSError), self._pipe, self._file.open("rb") as file:
            while True:
                ended = self._done.is_set()
                while chunk := file.read(CHUNK):
                    self._pipe.write(chunk)
                    self._pipe.flush()
                if ended:
                    return
                self._done.wait(POLL)
