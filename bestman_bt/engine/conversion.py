"""Conversion of text in a tree file to typed values: ``"3"`` to 3, ``"1.0;2.0"`` to a list, and your own types.

A type takes part by a classmethod ``from_string(text)``, or by an entry in a ``ConverterRegistry``. Lists separate
their items by ``;`` as in BehaviorTree.CPP; ``json:[1, 2]`` is accepted too.
"""

from __future__ import annotations

import enum
import json
import numbers
import operator
import re
import types
import typing
from collections.abc import Callable
from typing import Any

from bestman_bt.engine.errors import ConversionError
from bestman_bt.engine.status import STATUS_NAMES, NodeStatus

Converter = Callable[[str], Any]

_INTEGER = re.compile(r"-?\d{1,40}")
_REAL = re.compile(r"-?((\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|inf(inity)?|nan)", re.IGNORECASE)
_INT64 = range(-(2**63), 2**63)
_TRUE = frozenset(("1", "true", "TRUE", "True"))
_FALSE = frozenset(("0", "false", "FALSE", "False"))
UNTYPED = (Any, object)


def type_name(data_type: Any) -> str:
    """Return a readable name of a port's type, such as ``list[float]``."""
    if data_type is Any:
        return "any"
    if isinstance(data_type, type) and not isinstance(data_type, types.GenericAlias):
        return data_type.__name__
    return str(data_type).replace("typing.", "")


def compatible(first: Any, second: Any) -> bool:
    """Return whether one value can serve an entry that is used as both types."""
    options = [_options(first), _options(second)]
    return any(_compatible(a, b) for a in options[0] for b in options[1])


def _options(data_type: Any) -> list[Any]:
    if typing.get_origin(data_type) in (typing.Union, types.UnionType):
        return [option for option in typing.get_args(data_type) if option is not type(None)]
    return [data_type]


def _compatible(first: Any, second: Any) -> bool:
    if first == second or first in UNTYPED or second in UNTYPED:
        return True
    a, b = typing.get_origin(first) or first, typing.get_origin(second) or second
    if a in _SCALARS or b in _SCALARS or not isinstance(a, type) or not isinstance(b, type):
        return False
    return issubclass(a, b) or issubclass(b, a)


def to_bool(text: str) -> bool:
    """Convert ``true``/``false`` (also ``True``, ``TRUE``) and ``1``/``0``. Raises ConversionError for other text."""
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    raise ConversionError(f"'{text}' is not a bool (true, false, 1 or 0)")


def to_int(text: str) -> int:
    """Convert the decimal integer at the start of ``text``, as BehaviorTree.CPP does.

    Raises ConversionError if there is none, or if it does not fit into 64 bits.
    """
    match = _INTEGER.match(text)
    if match is not None:
        value = int(match.group())
        if value in _INT64:
            return value
    raise ConversionError(f"'{text}' is not an int")


def to_float(text: str) -> float:
    """Convert the decimal number at the start of ``text``, with or without an exponent, or ``inf`` and ``nan``.

    Raises ConversionError if there is none.
    """
    match = _REAL.match(text)
    if match is not None:
        return float(match.group())
    raise ConversionError(f"'{text}' is not a number")


def to_status(text: str) -> NodeStatus:
    """Convert the name of a status. Raises ConversionError for an unknown name."""
    if text in STATUS_NAMES:
        return NodeStatus[text]
    raise ConversionError(f"'{text}' is not a status (one of {', '.join(STATUS_NAMES)})")


def number_from_text(text: str) -> int | float | str:
    """Return the int or float if ``text`` is a number, else the text: the type of SubTree literals."""
    if _INTEGER.fullmatch(text) and int(text) in _INT64:
        return int(text)
    return float(text) if _REAL.fullmatch(text) else text


def partly_read(text: str, data_type: Any) -> bool:
    """Return whether more than spaces follows the number that is read from ``text``."""
    text = text.rstrip()
    if data_type is int:
        return _INTEGER.fullmatch(text) is None
    return data_type is float and _REAL.fullmatch(text) is None


def text_of_number(value: float) -> str:
    """Return a number as BehaviorTree.CPP prints it: integers in full, reals with six decimals."""
    return f"{value:f}" if isinstance(value, float) else str(int(value))


class ConverterRegistry:
    """Finds the converter of a type; ``register`` adds your own types."""

    def __init__(self) -> None:
        self._converters: dict[Any, Converter] = {
            bool: to_bool,
            int: to_int,
            float: to_float,
            str: str,
            NodeStatus: to_status,
        }
        self._found: dict[Any, Converter | None] = {}
        self.enums: dict[str, int] = {}

    def register(self, data_type: Any, converter: Converter) -> None:
        """Use ``converter`` for the literals of ports that declare ``data_type``."""
        self._converters[data_type] = converter
        self._found.clear()

    def converter(self, data_type: Any) -> Converter | None:
        """Return the converter of ``data_type``, or None if it has no text form."""
        try:
            return self._found[data_type]
        except KeyError:
            found = self._found[data_type] = self._search(data_type)
            return found

    def _search(self, data_type: Any) -> Converter | None:
        if data_type in UNTYPED:
            return str
        if data_type in self._converters:
            return self._converters[data_type]
        origin = typing.get_origin(data_type)
        arguments = typing.get_args(data_type)
        if origin in (typing.Union, types.UnionType):
            options = [a for a in arguments if a is not type(None)]
            return self._first_of(options, type_name(data_type))
        if origin in (list, tuple) or data_type in (list, tuple):
            return self._sequence(origin or data_type, arguments)
        if isinstance(data_type, type):
            from_string = getattr(data_type, "from_string", None)
            if callable(from_string):
                return self._guard(from_string, data_type)
            if issubclass(data_type, enum.Enum):
                return self._enum(data_type)
        return None

    def _first_of(self, options: list[Any], name: str) -> Converter | None:
        converters = [(option, c) for option in options if (c := self.converter(option)) is not None]
        if not converters:
            return None
        if len(converters) == 1:
            return converters[0][1]

        def convert(text: str) -> Any:
            for option, converter in converters:
                try:
                    if not partly_read(text, option):
                        return converter(text)
                except ConversionError:
                    continue
            raise ConversionError(f"'{text}' is not one of {name}")

        return convert

    def _sequence(self, container: Any, arguments: tuple[Any, ...]) -> Converter | None:
        item_types = [a for a in arguments if a is not Ellipsis] or [str]
        converters = [self.converter(item) for item in item_types]
        if any(c is None for c in converters):
            return None
        fixed = container is tuple and len(item_types) > 1

        def convert(text: str) -> Any:
            if text.startswith("json:"):
                try:
                    return container(json.loads(text[5:]))
                except (ValueError, TypeError) as error:
                    raise ConversionError(f"'{text}' is not a JSON list: {error}") from error
            parts = text.split(";")
            if parts and not parts[-1]:
                parts.pop()
            if fixed and len(parts) != len(converters):
                raise ConversionError(f"'{text}' must have {len(converters)} items separated by ';'")
            used = converters if fixed else converters[:1] * len(parts)
            return container(
                c(part if c is str else part.strip()) for c, part in zip(used, parts, strict=True) if c is not None
            )

        return convert

    def _enum(self, data_type: type[enum.Enum]) -> Converter:
        def convert(text: str) -> Any:
            if text in data_type.__members__:
                return data_type[text]
            value: Any = self.enums.get(text, text)
            if isinstance(value, str) and _INTEGER.fullmatch(value):
                value = int(value)
            try:
                return data_type(value)
            except ValueError as error:
                names = ", ".join(data_type.__members__)
                raise ConversionError(f"'{text}' is not one of {names}") from error

        return convert

    @staticmethod
    def _guard(from_string: Converter, data_type: type) -> Converter:
        def convert(text: str) -> Any:
            try:
                return from_string(text)
            except (ValueError, TypeError, KeyError, IndexError) as error:
                raise ConversionError(f"'{text}' is not a {data_type.__name__}: {error}") from error

        return convert


def text_of(value: Any) -> str:
    """Return the literal for ``value`` in a tree file; the inverse of the converters.

    Raises ConversionError if its type has no text form.
    """
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, (int, float)):
        return repr(value)
    to_string = getattr(value, "to_string", None)
    if callable(to_string):
        return str(to_string())
    if isinstance(value, (list, tuple)):
        return ";".join(text_of(item) for item in value)
    raise ConversionError(
        f"a {type(value).__name__} has no text form; give the type a to_string() method and a from_string()"
    )


def _as_bool(value: Any) -> bool | None:
    return bool(value) if isinstance(value, numbers.Number) or type(value).__name__ == "bool" else None


def _as_int(value: Any) -> int | None:
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return operator.index(value) if hasattr(value, "__index__") else None


def _as_float(value: Any) -> float | None:
    return float(value) if isinstance(value, numbers.Real) else None


def _as_text(value: Any) -> str | None:
    if isinstance(value, str):
        return value
    return text_of_number(value) if isinstance(value, (int, float)) else None


_SCALARS: dict[Any, Callable[[Any], Any]] = {bool: _as_bool, int: _as_int, float: _as_float, str: _as_text}
"""Each casts a value to that type, or returns None if something would be lost."""


def cast(value: Any, data_type: Any, registry: ConverterRegistry) -> Any:
    """Return ``value`` as ``data_type``: text is converted, numbers are cast if nothing is lost.

    Raises:
        ConversionError: the value has another type.
    """
    if data_type in UNTYPED:
        return value
    origin = typing.get_origin(data_type)
    if origin in (typing.Union, types.UnionType):
        return _cast_union(value, data_type, registry)
    plain = origin or data_type
    if isinstance(plain, type):
        if data_type in _SCALARS:
            scalar = _SCALARS[data_type](value)
            if scalar is not None:
                return scalar
        elif isinstance(value, plain):
            return value
        elif plain in (list, tuple) and isinstance(value, (list, tuple)):
            return plain(value)
    if isinstance(value, str):
        converter = registry.converter(data_type)
        if converter is not None:
            return converter(value)
    raise ConversionError(f"expected {type_name(data_type)} but got {value!r} ({type(value).__name__})")


def _cast_union(value: Any, data_type: Any, registry: ConverterRegistry) -> Any:
    for option in typing.get_args(data_type):
        if option is type(None):
            if value is None:
                return None
            continue
        try:
            if not (isinstance(value, str) and partly_read(value, option)):
                return cast(value, option, registry)
        except ConversionError:
            continue
    raise ConversionError(f"expected {type_name(data_type)} but got {value!r} ({type(value).__name__})")
