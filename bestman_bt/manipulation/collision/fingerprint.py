"""A hash of plain values: equal values give equal hashes, in every process."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

import numpy as np


def fingerprint(value: object) -> str:
    """32 hexadecimal digits for a value made of dataclasses, mappings, sets, sequences, arrays, texts and numbers.

    Raises TypeError for anything else.
    """
    return hashlib.blake2b(_encoded(value), digest_size=16).hexdigest()


def _encoded(value: object) -> bytes:
    """A description in which the type and the length of every part come before it, so that no two values share one."""
    match value:
        case np.ndarray():
            content = f"{value.dtype}{value.shape}".encode() + np.ascontiguousarray(value).tobytes()
        case None | str() | bool() | int() | float() | np.generic():
            content = repr(value).encode()
        case Mapping():
            content = b"".join(sorted(_encoded(item) for item in value.items()))
        case frozenset() | set():
            content = b"".join(sorted(_encoded(item) for item in value))
        case tuple() | list():
            content = b"".join(_encoded(item) for item in value)
        case _ if is_dataclass(value):
            content = b"".join(_encoded((field.name, getattr(value, field.name))) for field in fields(value))
        case _:
            raise TypeError(f"no fingerprint for a {type(value).__name__}")
    return f"{type(value).__name__}:{len(content)}:".encode() + content
