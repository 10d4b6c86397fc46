"""Splits a script into tokens, by the lexical rules of BehaviorTree.CPP 4.10 plus double-quoted strings."""

from __future__ import annotations

import re
from typing import NamedTuple

from bestman_bt.engine.errors import ScriptError

MAX_SCRIPT_LENGTH = 20_000

_TOKEN = re.compile(
    r"""[ \t\n\r]*(?:
    (?P<hex>0[xX][0-9a-fA-F]+)(?![\w.])
  | (?P<real>\d+\.\d+(?:[eE][+-]?\d+)?|\d+[eE][+-]?\d+)(?![A-Za-z_@])
  | (?P<integer>\d+)(?![A-Za-z_@]|\.(?!\.))
  | '(?P<single>[^']*)'
  | "(?P<double>[^"]*)"
  | (?P<name>[A-Za-z_@][A-Za-z0-9_]*)
  | (?P<operator>\.\.|&&|\|\||[=!<>:+\-*/]=|[-+*/&|^~!<>=?:();])
  | (?P<end>$)
)""",
    re.VERBOSE,
)


class Token(NamedTuple):
    """One token; ``kind`` is ``value`` (its value), ``name``, ``operator`` (its text) or ``end``."""

    kind: str
    value: int | float | str
    position: int


def tokenize(source: str) -> list[Token]:
    """Return the tokens of a script, ended by one of kind ``end``.

    Raises:
        ScriptError: the script is too long, or holds something that is no token.
    """
    if len(source) > MAX_SCRIPT_LENGTH:
        raise ScriptError(f"script has {len(source)} characters; at most {MAX_SCRIPT_LENGTH} are accepted")
    tokens: list[Token] = []
    position = 0
    while True:
        match = _TOKEN.match(source, position)
        if match is None:
            rest = source[position:].lstrip(" \t\n\r")
            start = len(source) - len(rest)
            raise ScriptError(f"invalid token at position {start}: {rest[:20]!r} in script '{_short(source)}'")
        kind = match.lastgroup or "end"
        text = match.group(kind)
        position = match.end()
        tokens.append(_token(kind, text, match.start(kind)))
        if kind == "end":
            return tokens


def _token(kind: str, text: str, position: int) -> Token:
    if kind == "hex":
        return Token("value", int(text, 16), position)
    if kind == "real":
        return Token("value", float(text), position)
    if kind == "integer":
        return Token("value", _integer(text), position)
    if kind in ("single", "double"):
        return Token("value", text, position)
    if kind == "name" and text in ("true", "false"):
        return Token("value", 1.0 if text == "true" else 0.0, position)
    return Token(kind, text, position)


def _integer(text: str) -> int:
    value = int(text) if len(text) <= 19 else 2**63
    if value >= 2**63:
        raise ScriptError(f"integer {text[:25]} does not fit into 64 bits")
    return value


def _short(source: str) -> str:
    return source if len(source) <= 80 else source[:77] + "..."
