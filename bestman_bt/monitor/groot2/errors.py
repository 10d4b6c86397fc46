"""What goes wrong between Groot2 and a tree."""

from __future__ import annotations

from bestman_bt.errors import Error


class Groot2Error(Error):
    """The publisher cannot serve: no library, no port, or a tree that the protocol cannot number."""


class RequestError(Error):
    """A request cannot be answered; its text is told to the one who asked."""
