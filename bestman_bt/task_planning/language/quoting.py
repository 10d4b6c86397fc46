"""Words of a model or a server, fit for a message: one line, printable, no longer than is read."""

from __future__ import annotations

LONGEST_QUOTE = 300


def quoted(text: str) -> str:
    """The text without control characters, such as those that move a terminal's cursor, cut at 300 characters."""
    line = " ".join("".join(character if character.isprintable() else " " for character in text).split())
    return line if len(line) <= LONGEST_QUOTE else line[:LONGEST_QUOTE] + "…"
