"""Suggestions for misspelt names."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import lru_cache


def closest(name: str, known: Iterable[str]) -> str:
    """Return the item of ``known`` that is spelled most like ``name``, or an empty text."""
    return _closest(name, tuple(known))


@lru_cache(maxsize=4096)  # comparing with all names of the palette takes a millisecond
def _closest(name: str, names: tuple[str, ...]) -> str:
    matches = difflib.get_close_matches(name, names, n=1, cutoff=0.6)
    if not matches:
        lowered = {other.lower(): other for other in names}
        matches = [lowered[m] for m in difflib.get_close_matches(name.lower(), list(lowered), n=1, cutoff=0.6)]
    return matches[0] if matches else ""
