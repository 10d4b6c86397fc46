"""The package pybullet (extra ``sim``). Real robots do not need it, so a missing package is reported only when a
simulation starts.

It is imported only here, without the line about its build time that it writes to standard error.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from bestman_bt.extras import missing_extra

__all__ = ["pybullet"]


class _Missing:
    """In place of the package: every use of it says what to install."""

    def __getattr__(self, name: str) -> Any:
        raise missing_extra("simulation", "sim")


@contextmanager
def _nothing_on_standard_error() -> Iterator[None]:
    """Redirect the standard error: a C library writes past ``sys.stderr``, to the file descriptor."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


try:
    with _nothing_on_standard_error():
        import pybullet
except ModuleNotFoundError:
    pybullet = _Missing()
