"""Log: a line of text with blackboard values, for log, page and terminal."""

from __future__ import annotations

import logging
import re
from typing import Any

from bestman_bt.engine import SUCCESS, ConversionError, In, SyncAction
from bestman_bt.engine.conversion import text_of

logger = logging.getLogger(__name__)

DECIMALS = 6
"""Number of decimals of floats: metres to a micrometre, and 0.3 instead of 0.30000000000000004."""

_REAL = re.compile(r"(?<![\w.])-?\d+(?:\.\d+(?:e[+-]?\d+)?|e[+-]?\d+)(?![\w.])")
_KEY = re.compile(r"\{([^{}]+)\}")


class Log(SyncAction):
    """Log ``text``, in which ``{key}`` is replaced by a blackboard entry; an entry without a value stays as written.

    Floats are rounded to six decimals. The line is the node's feedback and a record of Python's ``logging``.
    """

    text = In(object, "text to log, such as: the {object} is at {pose}")

    def on_tick(self) -> int:
        """Format the text and log it."""
        written = self.attributes["text"]
        text = _KEY.sub(self._value, written) if isinstance(written, str) else _text(written)
        self.feedback_message = text
        logger.info("%s", text)
        return SUCCESS

    def _value(self, key: re.Match[str]) -> str:
        value = self.board.get(key[1])
        return key[0] if value is None else _text(value)


def _text(value: Any) -> str:
    """Return a value as trees write it, with reals rounded to ``DECIMALS``, also those within a pose or a list."""
    if isinstance(value, str):
        return value
    try:
        text = text_of(value)
    except ConversionError:
        text = str(value)
    return _REAL.sub(lambda real: repr(round(float(real[0]), DECIMALS)), text)


class Say(Log):
    """Alias of ``Log``."""
