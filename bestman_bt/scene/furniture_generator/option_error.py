"""Errors of the options of generated furniture."""

from __future__ import annotations

from bestman_bt.errors import Error


class FurnitureOptionError(Error, ValueError):
    """Raised for an invalid option. ``path``: the option, for example ("handle", "length"); the message gives its value
    and what is accepted.
    """

    def __init__(self, path: tuple[str, ...], message: str) -> None:
        super().__init__(f"furniture option {'.'.join(path)}: {message}" if path else message)
        self.path = path
        self.reason = message
