"""What is wrong with the options of generated furniture."""

from __future__ import annotations

from bestman_bt.errors import Error


class FurnitureOptionError(Error, ValueError):
    """``path``: the option at fault, for example ("handle", "length"); the message gives its value and what fits."""

    def __init__(self, path: tuple[str, ...], message: str) -> None:
        super().__init__(f"furniture option {'.'.join(path)}: {message}" if path else message)
        self.path = path
        self.reason = message
