"""Errors of the twins."""

from __future__ import annotations


class TwinError(RuntimeError):
    """A twin cannot be made: no connection, no twin for its driver, no free address, or it did not start."""
