"""Errors of the twins."""

from __future__ import annotations

from bestman_bt.errors import Error


class TwinError(Error, RuntimeError):
    """A twin cannot be created: no connection, no twin for the driver, no free address, or it failed to start."""
