"""The error of the manipulation algorithms."""

from __future__ import annotations

from bestman_bt.errors import AlgorithmError


class ManipulationError(AlgorithmError, ValueError):
    """A request that cannot be executed: wrong shape, NaN, unknown name, impossible limits."""
