"""Splits a script into tokens, by the lexical rules of BehaviorTree.CPP 4.10 plus double-quoted strings."""

from __future__ import annotations

import math
import re

from bestman_bt.engine.errors import ScriptError

MAX_SCRIPT_LENGTH = 20_000

_TOKEN = re.compile(
    r"""
    (0[xX][0-9a-fA-F]+(?![\w.]) | \d+(?:\.\d+)?[eE][+-]?\d+(?![A-Za-z_@]) | \d+\.\d+(?![A-Za-z_@\d])
      | \d+(?![A-Za-z_@\d]|\.(?!\.)))
  | ('[^']*' | "[^"]*")
  | ([A-Za-z_][A-Za-z0-9_]*|@[A-Za-z0-9_]+)
  | (\.\.|&&|\|\||[=!<>:+\-*/]=|[-+*/&|^~!<>=?:();])
  | ([^ \t\n\r])
""",
    re.VERBOSE,
)
"""Groups: number, string, name, operator, and anything else, which is an error."""

Token = tuple[str, "int | float | str"]
"""Kind (``value``, ``name``, ``operator`` or ``end``) and value or text of one token."""

END: Token = ("end", "")


def tokenize(source: str) -> list[Token]:
    """Return the tokens of a script, ended by one of kind ``end``.

    Raises:
        ScriptError: the script is too long, or holds something that is no token.
    """
    if len(source) > MAX_SCRIPT_LENGTH:
        raise ScriptError(f"the script has {len(source)} characters; at most {MAX_SCRIPT_LENGTH} are accepted")
    tokens: list[Token] = []
    for number, string, name, operator, bad in _TOKEN.findall(source):
        if operator:
            tokens.append(("operator", operator))
        elif name:
            tokens.append(("value", 1.0 if name == "true" else 0.0) if name in ("true", "false") else ("name", name))
        elif number:
            tokens.append(("value", _number(number)))
        elif string:
            tokens.append(("value", string[1:-1]))
        else:
            position = position_of(source, len(tokens))
            raise ScriptError(
                f"invalid token '{bad}' at position {position} (near {source[position : position + 20]!r})"
            )
    tokens.append(END)
    return tokens


def position_of(source: str, index: int) -> int:
    """Return where in ``source`` the token number ``index`` begins; its length if there are fewer."""
    for count, match in enumerate(_TOKEN.finditer(source)):
        if count == index:
            return match.start()
    return len(source)


def _number(text: str) -> int | float:
    if text[:2] in ("0x", "0X"):
        value: int | float = int(text, 16)
    elif text.isdigit():
        value = int(text) if len(text) <= 19 else 2**63
    else:
        value = float(text)
        if math.isinf(value) or (value == 0.0 and text.partition("e")[0].strip("0.")):
            raise ScriptError(f"the number {text[:25]} does not fit into a double")
        return value
    return value if value < 2**63 else 0  # that is what BehaviorTree.CPP makes of it
