"""Errors of the twins."""

from __future__ import annotations

from bestman_bt.errors import Error


class TwinError(Error, RuntimeError):
    """A twin cannot be made: no connection, no twin for its driver, no free address, or it did not start."""
