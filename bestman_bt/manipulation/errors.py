"""The error of the manipulation algorithms."""

from __future__ import annotations


class ManipulationError(ValueError):
    """A request that cannot be carried out as asked: wrong shape, NaN, unknown name, impossible limits."""
