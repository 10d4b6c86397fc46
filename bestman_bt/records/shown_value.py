"""Blackboard entries for people and for files: short, for any value."""

from __future__ import annotations

import math
import reprlib
from typing import Any

import numpy as np

from bestman_bt.engine import EngineError
from bestman_bt.engine.conversion import text_of, type_name
from bestman_bt.records.events import ShownEntry

LONGEST_TEXT = 2000
"""Characters of a value's text."""
MOST_ITEMS = 64
"""Largest number of items of a list or dictionary that is shown in full."""
REMOVED = ShownEntry("", "")
"""The representation of a removed entry."""

_shortened = reprlib.Repr()
_shortened.maxlevel = 4
_shortened.maxdict = _shortened.maxlist = _shortened.maxtuple = _shortened.maxset = _shortened.maxdeque = 20
_shortened.maxstring = _shortened.maxother = LONGEST_TEXT


def show_value(value: Any, kind: Any = None) -> ShownEntry:
    """Return a value, and the type that its entry is locked to (by default the value's own); never raises."""
    try:
        name = type_name(type(value) if kind is None else kind)
        return ShownEntry(name, _text(value), value if _is_plain(value) else None)
    except Exception as error:  # noqa: BLE001 - the value is of a user's type, whose methods may raise anything
        return ShownEntry(type(value).__name__, f"cannot be shown: {type(error).__name__}")


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, np.ndarray):
        text = np.array2string(value, precision=4, threshold=40, edgeitems=2, separator=", ")
    elif isinstance(value, (list, tuple, set, frozenset, dict)):
        text = _shortened.repr(value)
    else:
        try:
            text = text_of(value)
        except EngineError:
            text = _shortened.repr(value)
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


def _is_plain(value: Any, depth: int = 2) -> bool:
    share = 1 if depth == 2 else 8
    if isinstance(value, str):
        return len(value) <= LONGEST_TEXT // (share * share)
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, bool) or value is None:
        return True
    if isinstance(value, int):
        return abs(value) < 2**53
    if depth and type(value) is list:
        return len(value) <= MOST_ITEMS // (1 if depth == 2 else 8) and all(
            _is_plain(item, depth - 1) for item in value
        )
    return False
