"""Semantics of the script operators: the arithmetic and conversions of BehaviorTree.CPP 4.10.

All numbers are treated as doubles; unlike in BehaviorTree.CPP, division by zero is an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from bestman_bt.engine.conversion import text_of_number
from bestman_bt.engine.errors import ScriptError

MAX_TEXT: Final = 1_000_000
"""Longest string that a script may build, so that a loop that doubles one does not fill the memory."""
EPSILON: Final = 1.1920928955078125e-07
"""Single-precision epsilon: numbers closer than this are equal."""

_NUMBER_IN_FRONT = re.compile(r"-?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def truth(value: Any) -> bool:
    """Return a script's result as a condition. Raises ScriptError unless it is a non-negative double, 0 or 1."""
    if isinstance(value, float) and not value < 0.0:
        return value != 0.0
    if isinstance(value, int) and value in (0, 1):
        return bool(value)
    raise ScriptError(f"{_shown(value)} is not a condition (use a comparison, 0, 1 or a positive double)")


def number_of_text(text: str, enums: Mapping[str, int]) -> float:
    """Return the numeric value of a string used as a number: true, false, an enum name or digits. Raises
    ScriptError.
    """
    if text in ("true", "false"):
        return 1.0 if text == "true" else 0.0
    if text in enums:
        return float(enums[text])
    match = _NUMBER_IN_FRONT.match(text)
    if match is None:
        raise ScriptError(f"the string '{text}' is not a number")
    return float(match.group())


def ternary_truth(value: Any) -> bool:
    """Return whether the condition of ``?:`` is true; a string is evaluated as the number at its start."""
    if isinstance(value, str):
        return number_of_text(value, {}) != 0
    if isinstance(value, (int, float)):
        return value != 0
    raise ScriptError(f"{_shown(value)} is not a condition of '?:'")


def negate(value: Any) -> float:
    """Return ``-value``."""
    return -_operand(value, "-")


def complement(value: Any) -> float:
    """Return ``~value`` of the 64-bit integer part."""
    number = _operand(value, "~")
    if not -(2.0**63) <= number < 2.0**63:
        raise ScriptError(f"{number} is out of range for bitwise operations")
    return float(~int(number))


def logical_not(value: Any) -> float:
    """Return 1.0 for zero, else 0.0."""
    return 0.0 if _operand(value, "!") else 1.0


def _operand(value: Any, operator: str) -> float:
    if isinstance(value, (int, float)):
        return float(value)
    raise ScriptError(f"operator [{operator}] does not apply to {_shown(value)}")


def add(left: Any, right: Any) -> Any:
    """Return the sum of two numbers, or two strings joined."""
    if isinstance(left, (int, float)) and isinstance(right, (int, float)):
        return float(left) + right
    if isinstance(left, str) and isinstance(right, str):
        return _joined(left, right)
    raise _not_permitted(left, "+", right)


def subtract(left: Any, right: Any) -> float:
    """Return ``left - right``."""
    a, b = _numbers(left, "-", right)
    return a - b


def multiply(left: Any, right: Any) -> float:
    """Return ``left * right``."""
    a, b = _numbers(left, "*", right)
    return a * b


def divide(left: Any, right: Any) -> float:
    """Return ``left / right``. Raises ScriptError if ``right`` is 0."""
    a, b = _numbers(left, "/", right)
    if b == 0.0:
        raise ScriptError(f"division by zero ({left} / {right})")
    return a / b


def concatenate(left: Any, right: Any) -> str:
    """Return two strings joined, or a string joined with the text of a number."""
    if isinstance(left, str):
        if isinstance(right, str):
            return _joined(left, right)
        if isinstance(right, (int, float)):
            return _joined(left, text_of_number(right))
    elif isinstance(right, str) and isinstance(left, (int, float)):
        return _joined(text_of_number(left), right)
    raise _not_permitted(left, "..", right)


def _joined(left: str, right: str) -> str:
    if len(left) + len(right) > MAX_TEXT:
        raise ScriptError(f"a string would have {len(left) + len(right)} characters; at most {MAX_TEXT} are accepted")
    return left + right


def bit_and(left: Any, right: Any) -> float:
    """Return ``left & right`` of two integers."""
    return float(_whole(left, "&", right) & _whole(right, "&", left))


def bit_or(left: Any, right: Any) -> float:
    """Return ``left | right`` of two integers."""
    return float(_whole(left, "|", right) | _whole(right, "|", left))


def bit_xor(left: Any, right: Any) -> float:
    """Return ``left ^ right`` of two integers."""
    return float(_whole(left, "^", right) ^ _whole(right, "^", left))


def logic_and(left: Any, right: Any) -> float:
    """Return 1.0 if both numbers are true, else 0.0; both sides are always evaluated."""
    _numbers(left, "&&", right)
    a, b = truth(left), truth(right)
    return 1.0 if a and b else 0.0


def logic_or(left: Any, right: Any) -> float:
    """Return 1.0 if either number is true, else 0.0; both sides are always evaluated."""
    _numbers(left, "||", right)
    a, b = truth(left), truth(right)
    return 1.0 if a or b else 0.0


BINARY: Final[Mapping[str, Callable[[Any, Any], Any]]] = {
    "+": add,
    "-": subtract,
    "*": multiply,
    "/": divide,
    "..": concatenate,
    "&": bit_and,
    "|": bit_or,
    "^": bit_xor,
    "&&": logic_and,
    "||": logic_or,
}

UNARY: Final[Mapping[str, Callable[[Any], float]]] = {"-": negate, "~": complement, "!": logical_not}


def _equal(a: Any, b: Any) -> bool:
    return bool(a == b) if isinstance(a, str) else abs(a - b) <= EPSILON


COMPARE: Final[Mapping[str, Callable[[Any, Any], bool]]] = {
    "==": _equal,
    "!=": lambda a, b: not _equal(a, b),
    "<": lambda a, b: not a >= b,
    ">": lambda a, b: not a <= b,
    "<=": lambda a, b: not a > b,
    ">=": lambda a, b: not a < b,
}


def comparable(left: Any, right: Any, enums: Mapping[str, int]) -> tuple[Any, Any]:
    """Return both sides of a comparison as two numbers or two strings. Raises ScriptError if they do not compare."""
    left_number = isinstance(left, (int, float))
    right_number = isinstance(right, (int, float))
    if left_number and right_number:
        return left, right
    left_text = isinstance(left, str)
    right_text = isinstance(right, str)
    if left_text and right_text:
        return left, right
    if left_text and right_number:
        return number_of_text(left, enums), right
    if left_number and right_text:
        return left, number_of_text(right, enums)
    raise ScriptError(f"cannot compare {_shown(left)} with {_shown(right)}")


def _numbers(left: Any, operator: str, right: Any) -> tuple[float, float]:
    if isinstance(left, (int, float)) and isinstance(right, (int, float)):
        return float(left), float(right)
    raise _not_permitted(left, operator, right)


def _whole(value: Any, operator: str, other: Any) -> int:
    if not isinstance(value, (int, float)) or not isinstance(other, (int, float)):
        raise _not_permitted(value, operator, other)
    if not math.isfinite(value) or value != int(value) or not -(2**63) <= value < 2**63:
        raise ScriptError(f"operator [{operator}] needs whole 64-bit numbers, not {value}")
    return int(value)


def _not_permitted(left: Any, operator: str, right: Any) -> ScriptError:
    for side, value in (("left", left), ("right", right)):
        if value is None:
            return ScriptError(f"the {side} operand of the operator [{operator}] is not initialized")
    return ScriptError(f"operation not permitted: {_shown(left)} {operator} {_shown(right)}")


def _shown(value: Any) -> str:
    if value is None:
        return "an empty entry"
    if isinstance(value, (int, float, str)):
        return repr(value)
    return f"a {type(value).__name__}"
