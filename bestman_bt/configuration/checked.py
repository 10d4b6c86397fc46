"""Documents to checked frozen dataclasses: all faults at once, each with file, line, field and remedy."""

from __future__ import annotations

import dataclasses
import functools
import re
import types
import typing
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bestman_bt.configuration.document import Document, FieldPath, dotted
from bestman_bt.configuration.errors import ConfigurationError, Problem, UnreadError
from bestman_bt.configuration.quantity import LIMITS
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
"""Pydantic's types of faults → the expected value, in YAML terms."""
_OF_PYDANTIC = re.compile(r"^(Value error,|Input|String|Tuple|Dictionary) ")
"""Precedes the expected value."""


def check(document: Document, dataclass_type: type[T]) -> T:
    """Build a frozen dataclass from a document.

    Raises ConfigurationError listing all unknown, missing and invalid fields.
    """
    value, problems = salvage(document, dataclass_type)
    if problems:
        raise ConfigurationError(problems)
    return value


def salvage(document: Document, dataclass_type: type[T]) -> tuple[T, list[Problem]]:
    """Check a document like ``check``, but omit invalid parts, so that the rest can be checked further.

    Returns the value and all problems. An invalid field has its default; one without a default raises UnreadError on
    access. Invalid entries of mappings and lists are omitted; ``numbered`` gives the original indices of list entries.
    """
    kind: Any = dataclass_type  # mypy takes the types of dataclasses for unhashable
    try:
        value: T = _adapter(kind).validate_python(document.data)
    except ValidationError:
        salvaging = _Salvaging(document)
        value = salvaging.fields(document.data, kind, ())
        return (_partial_of(kind, {}) if value is _UNREAD else value), salvaging.problems
    return value, []


def numbered(entries: Sequence[T]) -> Iterator[tuple[int, T]]:
    """Yield the entries of a list with their numbers in the file; ``salvage`` may have omitted some."""
    return zip(entries.numbers if isinstance(entries, _Left) else range(len(entries)), entries, strict=True)


def is_whole(value: Any) -> bool:
    """Return whether no required field of a salvaged value, or of its parts, is missing."""
    if dataclasses.is_dataclass(value):
        return not hasattr(type(value), "UNREAD") and all(map(is_whole, vars(value).values()))
    if isinstance(value, Mapping):
        return all(map(is_whole, value.values()))
    return not isinstance(value, tuple) or all(map(is_whole, value))


def override(document: Document, dataclass_type: type, values: Mapping[str, Any], prefix: str = "") -> Document:
    """Return ``document`` with dotted keys set to values.

    A key names fields of ``dataclass_type``, or existing entries of its mappings and lists; anything else is a
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
        document = document.merged(Document(nested, dict.fromkeys(field_paths(value, path), (source, None))))
    if problems:
        raise ConfigurationError(problems)
    return document


def _path_of(key: str, data: Any) -> FieldPath:
    """Return the field path of an error, such as ``goals.0.placed``, for a list ``goals`` in ``data``."""
    path: list[str | int] = []
    for part in key.split("."):
        path.append(int(part) if isinstance(data, list) and part.isdigit() else part)
        try:
            data = data[path[-1]]
        except (KeyError, IndexError, TypeError):
            data = None
    return tuple(path)


def field_paths(value: Any, path: FieldPath = ()) -> Iterator[FieldPath]:
    """Yield the paths of a value and of all values in it."""
    yield path
    if isinstance(value, (dict, list)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            yield from field_paths(inner, (*path, key))


@functools.cache
def _adapter(annotation: Any) -> TypeAdapter[Any]:
    """Return the cached type adapter: building one takes milliseconds, and a batch of episodes uses few types.

    It rejects infinity and NaN everywhere. Pydantic applies this setting to unions, not to dataclasses.
    """
    kind: Any = annotation  # mypy takes the types of dataclasses for no types
    if dataclasses.is_dataclass(annotation):
        kind = kind | None
    return TypeAdapter(kind, config=ConfigDict(allow_inf_nan=False, extra="forbid"))


_UNREAD: Any = object()
"""Placeholder for a value that could not be read."""


class _Left(tuple[Any, ...]):
    """The entries of a list that could be read, with their ``numbers`` in the file."""

    numbers: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class _Salvaging:
    """Reads a document value by value, by the annotations of dataclasses; faults are added to ``problems``."""

    document: Document
    problems: list[Problem] = dataclasses.field(default_factory=list)
    without_unit: list[FieldPath] = dataclasses.field(default_factory=list)

    def fields(self, data: Mapping[Any, Any], kind: Any, path: FieldPath) -> Any:  # noqa: C901 - one check after the other
        """Return a dataclass, which raises UnreadError for what is missing, where something is; none of fields that are
        wrong together, or one of them with the default of another.
        """
        known, read, lacking, count = _field_types(kind), dict[str, Any](), False, len(self.problems)
        for name, written in data.items():
            if name not in known:
                now = next((field.name for field in dataclasses.fields(kind) if field.metadata.get("was") == name), "")
                hint = f"it is called {now!r} now" if now else suggestion(str(name), list(known))
                self._add((*path, str(name)), f"unknown field; {hint}")
            elif (value := self._value(written, known[name], (*path, name))) is not _UNREAD:
                read[name] = value
        for field in dataclasses.fields(kind):
            if field.name in read or not field.init:
                continue
            if field.default_factory is not dataclasses.MISSING:
                read[field.name] = field.default_factory()
            elif field.default is not dataclasses.MISSING:
                read[field.name] = field.default
            else:
                lacking = True
                if field.name not in data:
                    self._add((*path, field.name), "is missing")
        if lacking:
            return _partial_of(kind, read)
        try:
            return kind(**read)
        except ValueError as error:
            if len(self.problems) == count:
                self._add_wrong_together(error, data, kind, path)
            return _UNREAD

    def _value(self, data: Any, annotation: Any, path: FieldPath) -> Any:
        kind = _arm_for(annotation, data)
        parted = isinstance(data, (list, Mapping)) and kind is not annotation
        if typing.get_origin(annotation) is typing.Annotated and parted:
            count = len(self.problems)
            read = self._value(data, typing.get_args(annotation)[0], path)
            return read if len(self.problems) > count else self._checked(data, annotation, path)
        if isinstance(data, Mapping) and dataclasses.is_dataclass(kind):
            return self.fields(data, kind, path)
        if isinstance(data, Mapping) and (inner := _value_type(kind)) is not None:
            return self._entries(data, inner, path)
        if isinstance(data, list) and typing.get_origin(kind) is tuple:
            return self._items(data, typing.get_args(kind), path)
        if isinstance(data, Mapping) and typing.get_origin(kind) is tuple:  # what was meant as its only entry
            self._add(path, f"should be a list, got {data!r}")
            return self._items([data], typing.get_args(kind), path)
        return self._checked(data, annotation, path)

    def _entries(self, data: Mapping[Any, Any], inner: Any, path: FieldPath) -> Any:
        read = {}
        for name, written in data.items():
            if not isinstance(name, str):
                self._add((*path, str(name)), f"a name should be text: write '{name}' in quotes")
            elif (value := self._value(written, inner, (*path, name))) is not _UNREAD:
                read[name] = value
        return read

    def _items(self, data: list[Any], kinds: tuple[Any, ...], path: FieldPath) -> Any:
        repeated = kinds[1:] == (Ellipsis,)
        if not repeated and len(data) != len(kinds):
            self._add(path, f"should have {len(kinds)} {'entry' if len(kinds) == 1 else 'entries'}, got {data!r}")
        inner = [kinds[0]] * len(data) if repeated else kinds
        read = [
            self._value(one, kind, (*path, index)) for index, (one, kind) in enumerate(zip(data, inner, strict=False))
        ]
        self._merge_unit_faults(path)
        if not repeated:
            return tuple(read) if len(data) == len(kinds) and _UNREAD not in read else _UNREAD
        left = _Left(value for value in read if value is not _UNREAD)
        left.numbers = tuple(index for index, value in enumerate(read) if value is not _UNREAD)
        return left

    def _checked(self, data: Any, annotation: Any, path: FieldPath) -> Any:
        """Check a value that has no parts."""
        try:
            return _adapter(annotation).validate_python(data)
        except ValidationError as error:
            faults = error.errors(include_url=False)
        words = dict.fromkeys(_words(fault, data) for fault in faults)
        message = " or ".join(one.removeprefix("should be ") if index else one for index, one in enumerate(words))
        if _holds_secret(annotation):
            message += "; its value is not shown"
        elif faults[0]["type"] not in ("quantity", "unit", LIMITS):
            message += f", got {'nothing' if data is None else repr(data)}"
        if faults[0]["type"] == "unit":
            self.without_unit.append(path)
        self._add(path, message)
        return _UNREAD

    def _merge_unit_faults(self, path: FieldPath) -> None:
        """Keep one fault of a list whose entries lack their units."""
        fields = [dotted(entry) for entry in self.without_unit if entry[:-1] == path]
        if len(fields) < 2:
            return
        at = next(index for index, problem in enumerate(self.problems) if problem.field == fields[0])
        message = f"{self.problems[at].message}; the same fault in {len(fields) - 1} more of this list"
        self.problems[at] = dataclasses.replace(self.problems[at], message=message)
        self.problems[:] = [problem for problem in self.problems if problem.field not in fields[1:]]

    def _add_wrong_together(self, error: ValueError, data: Mapping[Any, Any], kind: Any, path: FieldPath) -> None:
        if _holds_secret(kind):
            self._add(path, f"{error}; its value is not shown")
        elif isinstance(error, OrderError):
            given = [name for name in error.fields if name in data]
            given.sort(key=lambda name: (*path, name) not in self.document.origins)  # what was written, before defaults
            self._add((*path, *given[:1]), str(error))
        else:
            self._add(path, f"{error}, got {data!r}")

    def _add(self, path: FieldPath, message: str) -> None:
        self.problems.append(self.document.problem(path, message))


def _partial_of(kind: Any, read: Mapping[str, Any]) -> Any:
    partial = object.__new__(_partial_type(kind))
    for name, value in read.items():
        object.__setattr__(partial, name, value)
    return partial


@functools.cache
def _partial_type(kind: Any) -> Any:
    def unread(self: Any, name: str) -> Any:
        if name in _field_types(kind):
            raise UnreadError(name)
        raise AttributeError(name)

    def shown(self: Any) -> str:
        return f"{kind.__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())}, …)"

    return type(kind.__name__, (kind,), {"__getattr__": unread, "__repr__": shown, "UNREAD": True})


def _words(fault: Any, data: Any) -> str:
    """Return the expected value, in YAML terms."""
    kind, message = fault["type"], str(fault["msg"])
    if kind == "literal_error":
        return f"should be {fault['ctx']['expected']}"
    if kind == LIMITS:
        return f"{message}: [{data[1]}, {data[0]}], got [{data[0]}, {data[1]}]"
    return _PLAIN_WORDS.get(kind, _OF_PYDANTIC.sub("", message))


def _holds_secret(annotation: Any) -> bool:
    if any(isinstance(mark, SecretMark) for mark in getattr(annotation, "__metadata__", ())):
        return True
    if dataclasses.is_dataclass(annotation):
        return any(map(_holds_secret, _field_types(annotation).values()))
    if typing.get_origin(annotation) is typing.Annotated:
        return _holds_secret(typing.get_args(annotation)[0])
    return any(map(_holds_secret, typing.get_args(annotation)))


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
    """Return the annotation without ``Annotated`` and ``| None``."""
    while typing.get_origin(annotation) in (typing.Annotated, typing.Union, types.UnionType):
        arms = _arms(annotation)
        if len(arms) != 1:
            break
        annotation = arms[0]
    return annotation


def _arms(annotation: Any) -> list[Any]:
    """Return the alternatives of a type besides None."""
    if typing.get_origin(annotation) is typing.Annotated:
        return [typing.get_args(annotation)[0]]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return [arm for arm in typing.get_args(annotation) if arm is not type(None)]
    return [annotation]


def _arm_for(annotation: Any, data: Any) -> Any:
    """Return the alternative of a union type whose fields match ``data``, or ``annotation`` if none does."""
    arms = list(map(_bare, _arms(annotation)))
    lists = [arm for arm in arms if typing.get_origin(arm) is tuple]
    named = [arm for arm in arms if dataclasses.is_dataclass(arm) or _value_type(arm) is not None]
    fitting = lists if isinstance(data, list) else named or lists if isinstance(data, Mapping) else arms
    return fitting[0] if len(fitting) == 1 else annotation


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
