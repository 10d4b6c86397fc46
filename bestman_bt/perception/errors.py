"""What perception raises."""

from __future__ import annotations


class PerceptionError(Exception):
    """Input that an algorithm cannot work with; the message names the value and what would be accepted."""


class NoSurfaceError(PerceptionError):
    """No support surface was seen where one was expected; the message says how much was seen instead."""
