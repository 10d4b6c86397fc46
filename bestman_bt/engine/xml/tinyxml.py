"""Converts constructs that BehaviorTree.CPP's parser (TinyXML-2) accepts although they are not XML, such as ``code="a <
b && c"``, to XML.
"""

from __future__ import annotations

import re
from typing import Final

MOST_PLACES: Final = 10_000
"""Largest number of places in a file that are tolerated."""
_BARE_AMPERSAND = rb"&(?!(?:\#[0-9]+|\#x[0-9a-fA-F]+|amp|lt|gt|quot|apos);)"
_PIECES: Final = re.compile(
    rb"""(?P<comment><!--.*?(?:-->|\Z)) | <!\[CDATA\[.*?(?:\]\]>|\Z) | <\?.*?(?:\?>|\Z)
    | (?P<tag><[^\s<>/"'=!?]+) (?P<attributes>\s(?:\s*[^\s<>/"'=]+\s*=\s*(?:"[^"]*"|'[^']*'))+)
    | (?P<ampersand>%s)"""
    % _BARE_AMPERSAND,
    re.DOTALL | re.VERBOSE,
)
_ATTRIBUTE: Final = re.compile(rb"""(\s*)([^\s<>/"'=]+)(\s*=\s*)("[^"]*"|'[^']*')""")
_SPECIAL: Final = re.compile(b"<|" + _BARE_AMPERSAND)


class AsXml:
    """A file converted to XML: bare ``&`` and ``<`` in values, ``--`` in comments, and missing spaces before attributes
    are corrected. ``data``: the bytes, unchanged if there are more than ``MOST_PLACES`` such places; line numbers are
    preserved.
    """

    def __init__(self, given: bytes) -> None:
        self._given = given
        self._places: list[tuple[int, str]] = []
        try:
            self.data = _PIECES.sub(self._piece, given)
        except OverflowError:
            self.data = given

    def places(self) -> list[tuple[int, str]]:
        """Return the line of each change, and the fault there."""
        found, line, counted = [], 1, 0
        for at, what in sorted(self._places):
            line += self._given.count(b"\n", counted, at)
            counted = at
            found.append((line, f"{what}: BehaviorTree.CPP accepts it, XML does not"))
        return found

    def _note(self, at: int, what: str) -> None:
        if len(self._places) == MOST_PLACES:
            raise OverflowError
        self._places.append((at, what))

    def _piece(self, piece: re.Match[bytes]) -> bytes:
        if piece["attributes"]:
            begin = piece.start("attributes")
            return piece["tag"] + _ATTRIBUTE.sub(lambda found: self._attribute(found, begin), piece["attributes"])
        if piece["comment"] and len(piece[0]) >= len(b"<!---->") and piece[0].endswith(b"-->"):
            return self._comment(piece)
        return self._escaped(piece, 0) if piece["ampersand"] else piece[0]

    def _comment(self, piece: re.Match[bytes]) -> bytes:
        text = piece[0][len(b"<!--") : -len(b"-->")]
        if b"--" not in text and not text.endswith(b"-"):
            return piece[0]
        self._note(piece.start(), "a comment must not contain '--' or end with '-'")
        return b"<!--" + re.sub(rb"-(?=-|\Z)", b"- ", text) + b"-->"

    def _attribute(self, attribute: re.Match[bytes], begin: int) -> bytes:
        space, name, equals, value = attribute.groups()
        if not space:
            self._note(begin + attribute.start(), f"no space before the attribute '{name.decode('utf-8', 'replace')}'")
        begin += attribute.start(4)
        return (space or b" ") + name + equals + _SPECIAL.sub(lambda found: self._escaped(found, begin), value)

    def _escaped(self, found: re.Match[bytes], begin: int) -> bytes:
        character, escaped = ("<", "&lt;") if found[0] == b"<" else ("&", "&amp;")
        self._note(begin + found.start(), f"'{character}' must be written '{escaped}'")
        return escaped.encode()
