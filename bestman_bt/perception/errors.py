"""What perception raises."""

from __future__ import annotations

from bestman_bt.errors import AlgorithmError


class PerceptionError(AlgorithmError):
    """Input that an algorithm cannot work with; the message names the value and what would be accepted."""


class NoSurfaceError(PerceptionError):
    """No support surface was seen where one was expected; the message says how much was seen instead."""

    code = "surface_not_seen"


class DetectorModelError(PerceptionError):
    """A learned model that cannot be used: no such file, no such format, other inputs or outputs than expected."""


class DetectorUnreachableError(PerceptionError):
    """A remote detector gave no answer to any attempt; the message has the URL and the reason."""


class DetectorReplyError(PerceptionError):
    """A remote detector's answer breaks the protocol; the message has the URL and what is wrong with it."""
