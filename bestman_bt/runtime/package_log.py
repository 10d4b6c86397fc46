"""What our packages say to Python's ``logging`` while a run goes on becomes part of the run's log."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import ExitStack

from bestman_bt.records.events import Level, LogEvent

PACKAGES = ("bestman_bt", "behaviours", "hal")
_LEVELS: dict[int, Level] = {logging.ERROR: "error", logging.WARNING: "warning", logging.INFO: "info"}
"""From which number on a record has a level, highest first."""


class PackageLog(logging.Handler):
    """Makes events of records, from INFO on; a context manager. ``now``: the time as events have it."""

    def __init__(self, tell: Callable[[LogEvent], None], now: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self._tell, self._now = tell, now
        self._stack, self._formatter = ExitStack(), logging.Formatter()

    def __enter__(self) -> PackageLog:
        for name in PACKAGES:
            logger = logging.getLogger(name)
            self._stack.callback(logger.setLevel, logger.level)
            logger.setLevel(min(logging.INFO, logger.getEffectiveLevel()))
            logger.addHandler(self)
            self._stack.callback(logger.removeHandler, self)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def emit(self, record: logging.LogRecord) -> None:
        """Tell a record."""
        try:
            message = record.getMessage()
            if record.exc_info and record.exc_info[1] is not None:
                trace = self._formatter.formatException(record.exc_info)
                message = f"{message}: {record.exc_info[1]!r}\n{trace}"
        except Exception:  # noqa: BLE001 - as logging's own handlers: a wrong format is told, and harms nobody
            self.handleError(record)
            return
        level: Level = next((name for number, name in _LEVELS.items() if record.levelno >= number), "debug")
        self._tell(LogEvent(self._now(), level, message, logger=record.name))
