"""PyBullet without the line about its build time that it writes to standard error when it is first imported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def _nothing_on_standard_error() -> Iterator[None]:
    """A C library writes past ``sys.stderr``, to the file descriptor."""
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


with _nothing_on_standard_error():
    import pybullet

__all__ = ["pybullet"]
