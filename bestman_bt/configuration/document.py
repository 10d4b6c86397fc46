"""YAML documents that record the origin of each value."""

from __future__ import annotations

import copy
import re
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bestman_bt.configuration.errors import ConfigurationError, Problem

FieldPath = tuple[str | int, ...]
Origins = Mapping[FieldPath, tuple[str, int | None]]

_MAX_VALUES = 100_000  # aliases can make a short text mean more than a machine holds
_BOOLEAN, _TIME, _FLOAT = (f"tag:yaml.org,2002:{name}" for name in ("bool", "timestamp", "float"))


class _Loader(yaml.SafeLoader):
    """Scalars as in YAML 1.2: only true and false are booleans, 1e-3 is a number, dates are text."""


_FastLoader: Any = type("_FastLoader", (getattr(yaml, "CSafeLoader", yaml.SafeLoader),), {})
"""The same with libyaml, if available: ten times as fast, with less detailed error messages."""

for _loader in (_Loader, _FastLoader):
    _loader.yaml_implicit_resolvers = {
        first: [(tag, pattern) for tag, pattern in resolvers if tag not in (_BOOLEAN, _TIME)]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    _loader.add_implicit_resolver(_BOOLEAN, re.compile(r"^(?:true|false)$", re.IGNORECASE), list("tTfF"))
    _loader.add_implicit_resolver(_FLOAT, re.compile(r"^[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+$"), list("-+0123456789."))


@dataclass(frozen=True)
class Document:
    """Nested plain ``data`` with ``origins``: field path → (source, line); the root path is ``()``."""

    data: dict[str, Any]
    origins: Origins = field(default_factory=dict)

    def origin(self, path: FieldPath) -> tuple[str, int | None]:
        """Return source and line of the value at ``path``, else of its first entry, else of the nearest enclosing
        value."""
        for given, origin in self.origins.items() if path not in self.origins else ():
            if given[: len(path)] == path:
                return origin
        for end in range(len(path), -1, -1):
            if path[:end] in self.origins:
                return self.origins[path[:end]]
        return ("configuration", None)

    def problem(self, path: FieldPath, message: str) -> Problem:
        """Return a fault of the value at ``path``."""
        source, line = self.origin(path)
        return Problem(source, line, dotted(path), message)

    def count(self, path: FieldPath) -> int | None:
        """Return the number of entries of the list at ``path`` as written, including invalid ones; None if it is not a
        list.
        """
        written: Any = self.data
        for key in path:
            written = written.get(key) if isinstance(written, dict) else None
        return len(written) if isinstance(written, list) else None

    def merged(self, other: Document) -> Document:
        """Return this document overridden by ``other``: mappings are merged, other values replaced."""
        data = copy.deepcopy(self.data)
        origins = dict(self.origins)
        _merge(data, copy.deepcopy(other.data), (), origins, other.origins)
        if () in other.origins:
            origins[()] = other.origins[()]
        return Document(data, origins)

    def below(self, *path: str | int) -> Document:
        """Return the mapping at ``path`` as a document, with its origins."""
        data: Any = self.data
        for key in path:
            data = data[key]
        origins = {p[len(path) :]: origin for p, origin in self.origins.items() if p[: len(path)] == path}
        origins.setdefault((), self.origin(path))
        return Document(data, origins)


def dotted(path: FieldPath) -> str:
    """Return a field path in dotted notation: ``parts.arm.xyz[2]``."""
    text = ""
    for key in path:
        text += f"[{key}]" if isinstance(key, int) else f".{key}" if text else key
    return text


def read_document(path: Path, faults: list[Problem] | None = None) -> Document:
    """Read a YAML file that holds a mapping. Raises, and uses ``faults``, like ``parse_document``."""
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        message = f"is not UTF-8 text (byte {error.object[error.start]:#04x}): save the file as UTF-8"
        raise ConfigurationError([Problem(_display(path), line, "", message)]) from error
    except OSError as error:
        raise ConfigurationError([Problem(str(path), None, "", f"cannot be read: {error}")]) from error
    return parse_document(text, _display(path), faults)


def parse_document(text: str, source: str, faults: list[Problem] | None = None) -> Document:
    """Parse YAML text that holds a mapping; ``source`` names it in errors.

    Raises ConfigurationError with file and line for invalid YAML and for duplicate keys. With ``faults`` they are added
    there instead and the later value is used, so that the rest can also be checked.
    """
    problems: list[Problem] = []
    twice: list[Problem] = problems if faults is None else faults
    origins: dict[FieldPath, tuple[str, int | None]] = {}
    try:
        loader, root = _nodes(text)
        if root is None:
            origins[()] = (source, None)
        if root is not None:
            _record(root, (), source, origins, problems, twice, set())
        data = {} if root is None or problems else loader.construct_document(root)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else None
        raise ConfigurationError([Problem(source, line, "", f"is not YAML: {error.problem}")]) from error
    except yaml.YAMLError as error:
        raise ConfigurationError([Problem(source, None, "", f"is not YAML: {error}")]) from error
    except RecursionError as error:
        raise ConfigurationError([Problem(source, None, "", "is nested too deeply")]) from error
    except ValueError as error:  # as Python says of a whole number of more than 4300 digits
        raise ConfigurationError([Problem(source, None, "", f"holds a value that cannot be read: {error}")]) from error
    if not isinstance(data, dict):
        problems.append(Problem(source, 1, "", f"should hold fields (name: value), got {type(data).__name__}"))
    if problems:
        raise ConfigurationError(problems)
    return Document(data, origins)


def _nodes(text: str) -> tuple[Any, yaml.Node | None]:
    """Return a loader and the root node; what libyaml refuses is read again for the words of the error."""
    try:
        loader: Any = _FastLoader(text)
        return loader, loader.get_single_node()
    except yaml.YAMLError:
        loader = _Loader(text)
        return loader, loader.get_single_node()


def parse_value(text: str) -> Any:
    """Return the value of a YAML text. Raises ValueError if it is not YAML."""
    try:
        return yaml.load(text, Loader=_Loader)  # noqa: S506 - a safe loader
    except yaml.MarkedYAMLError as error:
        raise ValueError(f"the value is not YAML: {error.problem}") from error
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"the value is not YAML: {type(error).__name__}") from error


def _display(path: Path) -> str:
    """Return the path as people would type it: relative where it lies below the working directory."""
    try:
        return str(path.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(path)


def _record(
    node: yaml.Node,
    path: FieldPath,
    source: str,
    origins: dict[FieldPath, tuple[str, int | None]],
    problems: list[Problem],
    twice: list[Problem],
    around: set[int],
) -> None:
    line = node.start_mark.line + 1
    origins.setdefault(path, (source, line))
    if len(origins) > _MAX_VALUES:
        if not problems:
            problems.append(Problem(source, None, "", f"holds more than {_MAX_VALUES} values"))
        return
    if id(node) in around:
        problems.append(Problem(source, line, dotted(path), "contains itself"))
        return
    around = around | {id(node)}
    if isinstance(node, yaml.MappingNode):
        seen: set[Hashable] = set()
        for key_node, value_node in node.value:
            key = key_node.value
            if not isinstance(key_node, yaml.ScalarNode):
                problems.append(Problem(source, key_node.start_mark.line + 1, dotted(path), "a name should be text"))
                continue
            if key in seen:
                twice.append(Problem(source, key_node.start_mark.line + 1, dotted((*path, key)), "is given twice"))
            seen.add(key)
            origins[(*path, key)] = (source, key_node.start_mark.line + 1)
            _record(value_node, (*path, key), source, origins, problems, twice, around)
    elif isinstance(node, yaml.SequenceNode):
        for index, child in enumerate(node.value):
            _record(child, (*path, index), source, origins, problems, twice, around)


def _names_entries_of(there: Any, value: Mapping[Any, Any]) -> bool:
    """Return whether ``value``, index → entry, overlays a list."""
    return isinstance(there, list) and bool(value) and all(key in range(len(there)) for key in value)


def _merge(
    below: Any,
    above: Mapping[Any, Any],
    path: FieldPath,
    origins: dict[FieldPath, tuple[str, int | None]],
    above_origins: Origins,
) -> None:
    for key, value in above.items():
        here = (*path, key)
        there = below[key] if isinstance(below, list) else below.get(key)
        if isinstance(value, dict) and (isinstance(there, dict) or _names_entries_of(there, value)):
            _merge(there, value, here, origins, above_origins)
            continue
        below[key] = value
        for old in [p for p in origins if p[: len(here)] == here]:
            del origins[old]
        origins.update({p: o for p, o in above_origins.items() if p[: len(here)] == here})
