"""From documents to checked frozen dataclasses: every fault at once, each with file, line, field and remedy."""

from __future__ import annotations

import copy
import dataclasses
import functools
import types
import typing
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bestman_bt.configuration.document import Document, FieldPath
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.configuration.secret import SecretMark, shown_setting
from bestman_bt.messages.shapes import OrderError
from bestman_bt.registry import suggestion

T = TypeVar("T")

_PLAIN_WORDS = {
    "string_type": "should be text",
    "int_type": "should be a whole number",
    "int_parsing": "should be a whole number",
    "int_from_float": "should be a whole number",
    "float_type": "should be a number",
    "float_parsing": "should be a number without a unit (SI: metres, seconds, radians)",
    "bool_type": "should be true or false",
    "bool_parsing": "should be true or false",
    "tuple_type": "should be a list",
    "list_type": "should be a list",
    "dict_type": "should hold names (name: value)",
    "mapping_type": "should hold names (name: value)",
    "dataclass_type": "should hold fields (name: value)",
}
"""Pydantic's types of faults → what is owed, in the words of YAML."""


def check(document: Document, dataclass_type: type[T]) -> T:
    """Build a frozen dataclass from a document; ConfigurationError lists all unknown, missing and wrong fields."""
    value, problems = salvage(document, dataclass_type)
    if problems or value is None:
        raise ConfigurationError(problems)
    return value


def salvage(document: Document, dataclass_type: type[T]) -> tuple[T | None, list[Problem]]:
    """As ``check``, but what is wrong is left out of the value, so that the rest of it can be checked further.

    Also returns all problems; the value is None where what is wrong cannot be left out.
    """
    problems = [document.problem(*fault) for fault in _unknown_fields(document.data, dataclass_type, ())]
    kind: Any = dataclass_type  # mypy takes the types of dataclasses for unhashable
    data: Any = document.data
    first = True
    while True:  # leaving a value out may leave what holds it without something that it needs
        try:
            value: T = _adapter(kind).validate_python(data)
        except ValidationError as error:
            faults: list[dict[str, Any]] = [dict(fault) for fault in error.errors(include_url=False)]
        else:
            return value, problems
        if first:
            problems += _problems(document, kind, faults)
            data, first = copy.deepcopy(data), False
        if not _leave_out(data, kind, [tuple(fault["loc"]) for fault in faults]):
            return None, problems


def override(document: Document, dataclass_type: type, values: Mapping[str, Any], prefix: str = "") -> Document:
    """``document`` with dotted keys set to values.

    A key names fields of ``dataclass_type``, or entries of its mappings and lists that are there; anything else is a
    ConfigurationError that suggests the closest key. ``prefix`` is put before keys in errors (``scene.``).
    """
    problems: list[Problem] = []
    for key, value in values.items():
        source = shown_setting(f"{prefix}{key}={value}")
        path = _path_of(key, document.data)
        fault = _unknown_key(document.data, dataclass_type, path)
        if fault is not None:
            problems.append(Problem(source, None, "", fault))
            continue
        nested: Any = value
        for part in reversed(path):
            nested = {part: nested}
        document = document.merged(Document(nested, dict.fromkeys(_paths(value, path), (source, None))))
    if problems:
        raise ConfigurationError(problems)
    return document


def _path_of(key: str, data: Any) -> FieldPath:
    """``goals.0.placed``, where ``data`` has a list ``goals``, as field path."""
    path: list[str | int] = []
    for part in key.split("."):
        path.append(int(part) if isinstance(data, list) and part.isdigit() else part)
        try:
            data = data[path[-1]]
        except (KeyError, IndexError, TypeError):
            data = None
    return tuple(path)


def _paths(value: Any, path: FieldPath) -> Iterator[FieldPath]:
    """The path of a value, and those of all that it holds."""
    yield path
    if isinstance(value, (dict, list)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _paths(inner, (*path, key))


@functools.cache
def _adapter(dataclass_type: type) -> TypeAdapter[Any]:
    """Made once: that takes milliseconds, and a batch of episodes asks for the same few types.

    No number anywhere may be infinite or not a number. Pydantic takes this setting for unions, not for dataclasses.
    """
    union: Any = dataclass_type | None
    return TypeAdapter(union, config=ConfigDict(allow_inf_nan=False))


def _problems(document: Document, dataclass_type: Any, faults: list[dict[str, Any]]) -> list[Problem]:
    """One of each fault, and one of a list whose entries lack their units."""
    problems = []
    lists = Counter(tuple(fault["loc"])[:-1] for fault in faults if fault["type"] == "unit")
    for fault in faults:
        *holder, last = fault["loc"] or ("",)
        problem = _problem(document, dataclass_type, fault)
        if fault["type"] == "unit" and isinstance(last, int):
            others = lists.pop(tuple(holder), 0) - 1
            if others < 0:
                continue
            if others:
                problem = dataclasses.replace(
                    problem, message=f"{problem.message}; the same goes for {others} more of this list"
                )
        problems.append(problem)
    return problems


def _problem(document: Document, dataclass_type: Any, fault: dict[str, Any]) -> Problem:
    path: FieldPath = tuple(fault["loc"])
    if path and path[-1] == "[key]":
        name = path[-2]
        return document.problem((*path[:-2], str(name)), f"a name should be text: write '{name}' in quotes")
    message = str(fault["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    message = _PLAIN_WORDS.get(fault["type"], message)
    match fault["type"]:
        case "missing" | "missing_argument":
            return document.problem(path, "is missing")
        case "quantity" | "unit":
            return document.problem(path, message)
        case "literal_error":
            message = f"should be {fault['ctx']['expected']}"
    if _holds_secret(_annotation_at(dataclass_type, path)):
        return document.problem(path, f"{message}; its value is not shown")
    value = _written(document, path, fault["input"])
    error = fault.get("ctx", {}).get("error")
    if isinstance(error, OrderError):
        given = next((name for name in error.fields if name in value), None)
        return document.problem(path if given is None else (*path, given), message)
    return document.problem(path, f"{message}, got {'nothing' if value is None else repr(value)}")


def _leave_out(data: Any, annotation: Any, paths: Iterable[FieldPath]) -> bool:
    """Take out of ``data`` what is at the paths, or what holds it; False where something there cannot be left out."""
    for path in paths:
        end = _optional_part(annotation, path)
        if end == 0:
            return False
        holder = data
        for key in path[: end - 1]:
            holder = holder.get(key, {})
        holder.pop(path[end - 1], None)
    return True


def _optional_part(annotation: Any, path: FieldPath) -> int:
    """How much of a path leads to what can be left out: an entry of a mapping, or a field with a default; 0: none."""
    end = 0
    for depth, key in enumerate(path, start=1):
        annotation = _bare(annotation)
        if dataclasses.is_dataclass(annotation):
            field = next((f for f in dataclasses.fields(annotation) if f.name == key), None)
            if field is None:
                break
            if field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING:
                end = depth
            annotation = _field_types(annotation)[field.name]
        else:
            annotation = _value_type(annotation)
            if annotation is None:
                break
            end = depth
    return end


def _annotation_at(annotation: Any, path: FieldPath) -> Any:
    """The type of the value at ``path``, or, where that is not known, of the nearest value around it."""
    for key in path:
        bare = _bare(annotation)
        inner = _field_types(bare).get(str(key)) if dataclasses.is_dataclass(bare) else _value_type(bare)
        if inner is None:
            break
        annotation = inner
    return annotation


def _holds_secret(annotation: Any) -> bool:
    if any(isinstance(mark, SecretMark) for mark in getattr(annotation, "__metadata__", ())):
        return True
    if dataclasses.is_dataclass(annotation):
        return any(map(_holds_secret, _field_types(annotation).values()))
    if typing.get_origin(annotation) is typing.Annotated:
        return _holds_secret(typing.get_args(annotation)[0])
    return any(map(_holds_secret, typing.get_args(annotation)))


def _written(document: Document, path: FieldPath, converted: Any) -> Any:
    """The value at ``path`` as it was written: ``-2 mm`` where a check has been given -0.002."""
    value: Any = document.data
    for key in path:
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            return converted
    return value


def _unknown_fields(data: Any, annotation: Any, path: FieldPath) -> list[tuple[FieldPath, str]]:
    if not isinstance(data, (Mapping, list, tuple)):
        return []
    annotation = _bare(annotation)
    if dataclasses.is_dataclass(annotation) and isinstance(data, Mapping):
        known = _field_types(annotation)
        faults: list[tuple[FieldPath, str]] = []
        for key, value in data.items():
            if key in known:
                faults += _unknown_fields(value, known[key], (*path, key))
            else:
                faults.append(((*path, str(key)), f"unknown field; {suggestion(str(key), list(known))}"))
        return faults
    if isinstance(data, Mapping):
        item = _value_type(annotation)
        return [fault for key, value in data.items() for fault in _unknown_fields(value, item, (*path, key))]
    items = _item_types(annotation, len(data))
    return [
        fault
        for index, (value, item) in enumerate(zip(data, items, strict=True))
        for fault in _unknown_fields(value, item, (*path, index))
    ]


def _unknown_key(data: Any, annotation: Any, keys: FieldPath) -> str | None:
    path = tuple(map(str, keys))
    for depth, part in enumerate(path):
        annotation = _bare(annotation)
        there = ".".join(path[:depth])
        if isinstance(data, (list, tuple)):
            if not part.isdigit() or int(part) >= len(data):
                count = f"{len(data)} {'entry' if len(data) == 1 else 'entries'}"
                return f"unknown key '{there}.{part}': {there!r} has {count}, {there}.0 is the first"
            annotation, data = _item_types(annotation, len(data))[int(part)], data[int(part)]
            continue
        if dataclasses.is_dataclass(annotation):
            known = _field_types(annotation)
            if part not in known:
                names = {f"{there}.{name}" if there else name for name in known}
                return f"unknown key {'.'.join(path[: depth + 1])!r}; {suggestion('.'.join(path), sorted(names))}"
            annotation = known[part]
        else:
            item = _value_type(annotation)
            if item is None:
                return f"{there!r} has no fields" if annotation is not Any else None
            if item is not Any and part not in (data or {}):
                return f"unknown key {'.'.join(path[: depth + 1])!r}; {suggestion(part, list(data or {}))}"
            annotation = item
        data = data.get(part) if isinstance(data, Mapping) else None
    return None


def _field_types(dataclass_type: Any) -> dict[str, Any]:
    return _cached_field_types(dataclass_type)


@functools.cache
def _cached_field_types(dataclass_type: Any) -> dict[str, Any]:
    hints = typing.get_type_hints(dataclass_type, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(dataclass_type) if field.init}


def _bare(annotation: Any) -> Any:
    """The annotation without ``Annotated`` and ``| None``."""
    while True:
        origin = typing.get_origin(annotation)
        if origin is typing.Annotated:
            annotation = typing.get_args(annotation)[0]
        elif origin in (typing.Union, types.UnionType):
            inner = [a for a in typing.get_args(annotation) if a is not type(None)]
            if len(inner) != 1:
                return annotation
            annotation = inner[0]
        else:
            return annotation


def _value_type(annotation: Any) -> Any:
    origin = typing.get_origin(annotation)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return typing.get_args(annotation)[1]
    return None


def _item_types(annotation: Any, count: int) -> list[Any]:
    arguments = typing.get_args(annotation) if typing.get_origin(annotation) is tuple else ()
    if len(arguments) == 2 and arguments[1] is Ellipsis:
        return [arguments[0]] * count
    return list(arguments) if len(arguments) == count else [None] * count
