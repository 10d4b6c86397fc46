"""The faults of a configuration: all problems of a file at once."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from bestman_bt.errors import InputError

P = ParamSpec("P")
T = TypeVar("T")


@dataclass(frozen=True)
class Problem:
    """One fault. ``source``: a file or ``--set key=value``. ``line``: counts from 1; None if no line applies.

    ``field``: dotted path of the field; empty for the whole file.
    """

    source: str
    line: int | None
    field: str
    message: str

    def __str__(self) -> str:
        place = self.source if self.line is None else f"{self.source}:{self.line}"
        return f"{place}: {self.field}: {self.message}" if self.field else f"{place}: {self.message}"


class ConfigurationError(InputError, ValueError):
    """A configuration cannot be used; ``problems`` lists every fault found, each with file, line and field."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def within(self, *path: str) -> ConfigurationError:
        """Return the same faults with a prefix on their fields: ``drawers`` within ``generate.drawers``."""
        outer = ".".join(path)
        return ConfigurationError(
            replace(problem, field=f"{outer}.{problem.field}" if problem.field else outer) for problem in self.problems
        )


class UnreadError(ConfigurationError):
    """Raised on access to a field that could not be read. It lists no problems: the fault is already reported."""

    def __init__(self, field: str) -> None:
        super().__init__(())
        self.args = (f"{field!r} could not be read",)


class _Unread:
    def __getattr__(self, name: str) -> Any:
        raise UnreadError(name)


UNREAD: Any = _Unread()
"""Placeholder for a value that could not be read: any access raises UnreadError."""


def up_to_unread_field(check: Callable[P, Iterable[T]]) -> Callable[P, Iterator[T]]:
    """Wrap a check of a salvaged value so that it ends at the first access to an unread field."""

    @wraps(check)
    def checked(*args: P.args, **kwargs: P.kwargs) -> Iterator[T]:
        with suppress(UnreadError):
            yield from check(*args, **kwargs)

    return checked


_PARAMETERS = {"set": "settings", "plugin": "plugins"}
_OPTION = r"--(robot|scene|seed|task|world|set|plugin|driver|goal|given|planner|builder|limits)\b"
_GIVEN = re.compile(rf"{_OPTION} (.*)", re.DOTALL)
_NAMED = re.compile(rf"{_OPTION}(?: ([^\s;,)]*[^\s:;,)]))?")


@contextmanager
def naming_python_parameters() -> Iterator[None]:
    """Name parameters of Python functions, instead of command-line options, in faults raised within the context."""
    try:
        yield
    except InputError as error:
        problems = getattr(error, "problems", None)
        if problems is None:
            raise
        raise type(error)([_problem_in_python(problem) for problem in problems]) from error


def in_python(text: str) -> str:
    """Return a text with the names of command-line options replaced by Python parameters."""
    if text == "command line":
        return "arguments"
    return (_GIVEN if _GIVEN.fullmatch(text) else _NAMED).sub(_as_parameter, text)


def _problem_in_python(problem: Any) -> Any:
    """Return a Problem of a configuration, or of a tree."""
    texts = {name: getattr(problem, name) for name in ("source", "message", "suggestion") if hasattr(problem, name)}
    return replace(problem, **{name: in_python(text) for name, text in texts.items()})


def _as_parameter(option: re.Match[str]) -> str:
    name, value = _PARAMETERS.get(option[1], option[1]), option[2]
    if value is None:
        return name
    if name != option[1]:
        return f"{name}=[{value!r}]"
    return f"{name}={value if name == 'seed' else repr(value)}"


@dataclass
class ProblemCollector:
    """Collects the faults of several steps, so that one failure does not hide others."""

    problems: list[Problem] = field(default_factory=list)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Collect the faults of a ConfigurationError that the body raises, and continue after it."""
        try:
            yield
        except ConfigurationError as error:
            self.problems += error.problems

    def raise_if_any(self) -> None:
        """Raise ConfigurationError with all collected faults, each once, those of a file in line order."""
        if self.problems:
            place = {source: at for at, source in enumerate(dict.fromkeys(one.source for one in self.problems))}
            once = dict.fromkeys(self.problems)
            raise ConfigurationError(sorted(once, key=lambda one: (place[one.source], one.line or 0)))
