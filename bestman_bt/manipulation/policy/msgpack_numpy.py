"""Numpy arrays in msgpack, as openpi's servers and clients write them.

An array is a map with the *byte string* keys ``__ndarray__``, ``data``, ``dtype`` (as ``<f4``) and ``shape``; a numpy
scalar one with ``__npgeneric__``, ``data`` and ``dtype``.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from bestman_bt.errors import MissingExtraError
from bestman_bt.extras import install_command
from bestman_bt.manipulation.policy.errors import PolicyServerError

_BROKEN = (ValueError, TypeError, KeyError, OverflowError, SyntaxError)
"""What wrong bytes end in, beside msgpack's own errors; numpy parses the names of types as Python."""


def pack(value: Any) -> bytes:
    """Bytes of maps, lists, text, numbers and numpy arrays."""
    return bytes(_msgpack().packb(value, default=_to_map))


def unpack(data: bytes) -> Any:
    """The inverse of ``pack``; PolicyServerError for anything else, objects and Python pickles included."""
    msgpack = _msgpack()
    try:
        return msgpack.unpackb(data, object_hook=_from_map)
    except (msgpack.UnpackException, *_BROKEN) as error:
        raise PolicyServerError(f"{len(data)} bytes are no msgpack with numpy arrays: {error!r}") from error


def _msgpack() -> Any:
    try:
        import msgpack
    except ImportError as error:
        raise MissingExtraError(f"policy/openpi needs msgpack: {install_command('policy')}") from error
    return msgpack


def _to_map(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic) and value.dtype.kind in "VOc":
        raise ValueError(f"arrays of {value.dtype} cannot be sent")
    if isinstance(value, np.ndarray):
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    if isinstance(value, np.generic):
        return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
    raise TypeError(f"{type(value).__name__} cannot be sent")


def _from_map(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        dtype = np.dtype(value[b"dtype"])
        if dtype.kind in "VOc":
            raise ValueError(f"arrays of {dtype} are not accepted")
        return np.frombuffer(value[b"data"], dtype=dtype).reshape(value[b"shape"])
    if b"__npgeneric__" in value:
        return np.dtype(value[b"dtype"]).type(value[b"data"])
    return value
