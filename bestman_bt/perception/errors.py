"""Errors of perception."""

from __future__ import annotations

from bestman_bt.errors import AlgorithmError


class PerceptionError(AlgorithmError):
    """Raised for input that an algorithm cannot process; the message gives the value and what is accepted."""


class NoSurfaceError(PerceptionError):
    """Raised if no support surface was seen where one was expected; the message states how much was seen instead."""

    code = "surface_not_seen"


class DetectorModelError(PerceptionError):
    """Raised for an unusable learned model: missing file, wrong format, or unexpected inputs or outputs."""


class DetectorUnreachableError(PerceptionError):
    """A remote detector gave no answer to any attempt; the message has the URL and the reason."""


class DetectorReplyError(PerceptionError):
    """Raised if the reply of a remote detector violates the protocol; the message gives the URL and the fault."""
