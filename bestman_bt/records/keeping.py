"""Robust writing of a run's files: a full disk ends the recording, never the run."""

from __future__ import annotations

import sys
from collections.abc import Callable


class RecordingErrors:
    """The write errors of one run. The first failure is reported on standard error, in one line.

    ``lost``: incomplete files, such as ``motion.jsonl`` → why.
    """

    def __init__(self) -> None:
        self.lost: dict[str, str] = {}

    def write(self, what: str, write: Callable[[], object]) -> bool:
        """Write and return whether it succeeded; a file that failed once is not written again."""
        if what in self.lost:
            return False
        try:
            write()
        except OSError as error:
            self.mark_lost(what, error)
            return False
        return True

    def mark_lost(self, what: str, error: OSError) -> None:
        """Mark ``what`` as no longer recorded."""
        why = error.strerror or str(error)
        if not self.lost:
            sys.stderr.write(f"bestman-bt: NOT KEPT from here on: {what} ({why}); the run goes on\n")
            sys.stderr.flush()
        self.lost.setdefault(what, why)
