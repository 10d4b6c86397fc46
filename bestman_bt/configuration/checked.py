"""From documents to checked frozen dataclasses: every fault at once, each with file, line, field and remedy."""

from __future__ import annotations

import dataclasses
import functools
import types
import typing
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from bestman_bt.configuration.document import Document, FieldPath
from bestman_bt.configuration.errors import ConfigurationError, Problem
from bestman_bt.registry import suggestion

T = TypeVar("T")


def check(document: Document, dataclass_type: type[T]) -> T:
    """Build a frozen dataclass from a document; ConfigurationError lists all unknown, missing and wrong fields."""
    problems = [document.problem(*fault) for fault in _unknown_fields(document.data, dataclass_type, ())]
    kind: Any = dataclass_type  # mypy takes the types of dataclasses for unhashable
    try:
        value: T = _adapter(kind).validate_python(document.data)
    except ValidationError as error:
        problems += [_problem(document, dict(fault)) for fault in error.errors(include_url=False)]
        raise ConfigurationError(problems) from error
    if problems:
        raise ConfigurationError(problems)
    return value


def override(document: Document, dataclass_type: type, values: Mapping[str, Any], prefix: str = "") -> Document:
    """``document`` with dotted keys set to values.

    A key names fields of ``dataclass_type`` or entries of its mappings that are there; anything else is a
    ConfigurationError that suggests the closest key. ``prefix`` is put before keys in errors (``scene.``).
    """
    problems: list[Problem] = []
    for key, value in values.items():
        source = f"--set {prefix}{key}={value}"
        path = tuple(key.split("."))
        fault = _unknown_key(document.data, dataclass_type, path)
        if fault is not None:
            problems.append(Problem(source, None, "", fault))
            continue
        nested: Any = value
        for part in reversed(path):
            nested = {part: nested}
        document = document.merged(Document(nested, {path: (source, None)}))
    if problems:
        raise ConfigurationError(problems)
    return document


@functools.cache
def _adapter(dataclass_type: type) -> TypeAdapter[Any]:
    """Made once: that takes milliseconds, and a batch of episodes asks for the same few types."""
    return TypeAdapter(dataclass_type)


def _problem(document: Document, fault: dict[str, Any]) -> Problem:
    path: FieldPath = tuple(fault["loc"])
    match fault["type"]:
        case "missing" | "missing_argument":
            return document.problem(path, "is missing")
        case "dataclass_type":
            return document.problem(path, f"should hold fields (name: value), got {fault['input']!r}")
        case "literal_error":
            return document.problem(path, f"should be {fault['ctx']['expected']}, got {fault['input']!r}")
        case "quantity":
            return document.problem(path, str(fault["msg"]))
    message = str(fault["msg"]).removeprefix("Value error, ").removeprefix("Input ")
    return document.problem(path, f"{message}, got {_written(document, path, fault['input'])!r}")


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
    if isinstance(data, (list, tuple)):
        items = _item_types(annotation, len(data))
        return [
            fault
            for index, (value, item) in enumerate(zip(data, items, strict=True))
            for fault in _unknown_fields(value, item, (*path, index))
        ]
    return []


def _unknown_key(data: Any, annotation: Any, path: tuple[str, ...]) -> str | None:
    for depth, part in enumerate(path):
        annotation = _bare(annotation)
        there = ".".join(path[:depth])
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
