"""What a run writes down while it goes on: a disk that takes nothing more ends the writing, never the run."""

from __future__ import annotations

import sys
from collections.abc import Callable


class Keeping:
    """Writes for one run. The first write that fails is told on standard error, in one line.

    ``lost``: what is no longer kept, such as ``motion.jsonl`` → why.
    """

    def __init__(self) -> None:
        self.lost: dict[str, str] = {}

    def write(self, what: str, write: Callable[[], object]) -> bool:
        """Return whether it could be written; nothing more is tried of what has failed once."""
        if what in self.lost:
            return False
        try:
            write()
        except OSError as error:
            self.lose(what, error)
            return False
        return True

    def lose(self, what: str, error: OSError) -> None:
        """Nothing more is kept of ``what``."""
        why = error.strerror or str(error)
        if not self.lost:
            sys.stderr.write(f"bestman-bt: NOT KEPT from here on: {what} ({why}); the run goes on\n")
            sys.stderr.flush()
        self.lost.setdefault(what, why)
