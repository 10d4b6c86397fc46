"""Pratt parser of the script language: text to a list of expression trees."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Final

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
        ScriptError: the script is too long, or contains an invalid token.
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
    """Return the position in ``source`` of token number ``index``; its length if there are fewer tokens."""
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


MAX_SCRIPT_DEPTH = 100
MAX_OPERATORS = 250
"""Largest number of operators in one statement, which bounds the depth of the left-leaning expression tree."""

_ASSIGNMENTS: Final = (":=", "=", "+=", "-=", "*=", "/=")
_COMPARISONS: Final = ("==", "!=", "<", ">", "<=", ">=")
_ASSIGNMENT_POWER: Final = 2
_TERNARY_POWER: Final = 4
_COMPARISON_POWER: Final = 10
_PREFIX_POWER: Final = 20
_POWERS: Final[dict[int | float | str, int]] = {
    **dict.fromkeys(_ASSIGNMENTS, _ASSIGNMENT_POWER),
    "?": _TERNARY_POWER,
    "||": 6,
    "&&": 8,
    **dict.fromkeys(_COMPARISONS, _COMPARISON_POWER),
    "|": 12,
    "^": 12,
    "&": 14,
    "+": 16,
    "-": 16,
    "..": 16,
    "*": 18,
    "/": 18,
}


@dataclass(frozen=True, slots=True)
class Constant:
    """A number or a string."""

    value: int | float | str


@dataclass(frozen=True, slots=True)
class Name:
    """A blackboard key or the name of an enum value."""

    name: str


@dataclass(frozen=True, slots=True)
class Unary:
    """``-x``, ``~x`` or ``!x``."""

    operator: str
    operand: Expression


@dataclass(frozen=True, slots=True)
class Binary:
    """An arithmetic, bit, logic or concatenation operator and its operands."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Comparison:
    """A chain such as ``a < b <= c``: one more operand than operators."""

    operators: tuple[str, ...]
    operands: tuple[Expression, ...]


@dataclass(frozen=True, slots=True)
class Ternary:
    """``condition ? then : otherwise``."""

    condition: Expression
    then: Expression
    otherwise: Expression


@dataclass(frozen=True, slots=True)
class Assignment:
    """An assignment to the blackboard key ``name``; without a name it is an error at run time, as in v4."""

    operator: str
    name: str
    value: Expression


Expression = Constant | Name | Unary | Binary | Comparison | Ternary | Assignment


def parse_script(source: str) -> list[Expression]:
    """Return the statements of a script.

    Raises:
        ScriptError: the script is empty, too long, nested too deeply, or does not follow the grammar.
    """
    return _Parser(source).statements()


def assigns_to_no_key(statement: Expression) -> bool:
    """Return whether a statement, or an assignment on the right of its ``:=``, assigns to something other than a
    blackboard key.
    """
    while isinstance(statement, Assignment):
        if not statement.name:
            return True
        statement = statement.value
    return False


class _Parser:
    def __init__(self, source: str) -> None:
        self._source = source
        self._tokens = tokenize(source)
        self._index = 0
        self._depth = 0
        self._operators = 0

    def statements(self) -> list[Expression]:
        found: list[Expression] = []
        while self._tokens[self._index][0] != "end":
            self._operators = 0
            found.append(self._expression(0))
            while self._is(";"):
                self._index += 1
        if not found:
            raise ScriptError("the script is empty")
        return found

    def _peek(self) -> Token:
        return self._tokens[self._index]

    def _next(self) -> Token:
        token = self._tokens[self._index]
        if token[0] != "end":
            self._index += 1
        return token

    def _is(self, operator: str) -> bool:
        token = self._tokens[self._index]
        return token[0] == "operator" and token[1] == operator

    def _expect(self, operator: str) -> None:
        if not self._is(operator):
            raise self._error(f"expected '{operator}'")
        self._index += 1

    def _error(self, what: str, back: int = 0) -> ScriptError:
        """Return an error at the current token, or ``back`` tokens before it."""
        index = self._index - back
        kind, value = self._tokens[index]
        source = self._source if len(self._source) <= 80 else self._source[:77] + "..."
        got = "the end" if kind == "end" else f"'{value}'"
        position = position_of(self._source, index)
        return ScriptError(f"{what} at position {position} (got {got}) in script '{source}'")

    def _expression(self, minimum: int) -> Expression:
        self._depth += 1
        if self._depth > MAX_SCRIPT_DEPTH:
            raise self._error(f"the script is nested deeper than {MAX_SCRIPT_DEPTH}")
        left = self._prefix()
        while True:
            kind, operator = self._tokens[self._index]
            power = _POWERS.get(operator, -1) if kind == "operator" else -1
            if power < 0 or power < minimum:
                break
            self._operators += 1
            if self._operators > MAX_OPERATORS:
                raise self._error(f"more than {MAX_OPERATORS} operators in one statement")
            if power == _ASSIGNMENT_POWER:
                left = self._assignment(left)
                break
            if power == _TERNARY_POWER:
                left = self._ternary(left)
                break
            if power == _COMPARISON_POWER:
                left = self._comparison(left)
                continue
            self._index += 1
            left = Binary(str(operator), left, self._expression(power + 1))
        self._depth -= 1
        return left

    def _prefix(self) -> Expression:
        kind, value = self._next()
        if kind == "value":
            return Constant(value)
        if kind == "name":
            return Name(str(value))
        if kind == "operator":
            if value in ("-", "~", "!"):
                return Unary(str(value), self._expression(_PREFIX_POWER))
            if value == "(":
                inner = self._expression(0)
                self._expect(")")
                return inner
        raise self._error("expected operand", back=0 if kind == "end" else 1)

    def _assignment(self, left: Expression) -> Expression:
        operator = str(self._next()[1])
        name = left.name if isinstance(left, Name) else ""
        return Assignment(operator, name, self._expression(0))

    def _ternary(self, condition: Expression) -> Expression:
        self._next()
        then = self._expression(0)
        self._expect(":")
        return Ternary(condition, then, self._expression(_TERNARY_POWER))

    def _comparison(self, first: Expression) -> Expression:
        operators: list[str] = []
        operands = [first]
        while self._peek()[1] in _COMPARISONS and self._peek()[0] == "operator":
            self._operators += 1
            operators.append(str(self._next()[1]))
            operands.append(self._expression(_COMPARISON_POWER + 1))
        return Comparison(tuple(operators), tuple(operands))
