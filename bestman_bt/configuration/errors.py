"""What is wrong with a configuration: all problems of a file at once."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from bestman_bt.errors import InputError


@dataclass(frozen=True)
class Problem:
    """One fault: ``source`` is a file or ``--set key=value``, ``line`` counts from 1 (None: no line applies).

    ``field``: dotted path of the field, empty for the whole file.
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
        """The same faults, their fields named from further out: ``drawers`` within ``generate.drawers``."""
        outer = ".".join(path)
        return ConfigurationError(
            replace(problem, field=f"{outer}.{problem.field}" if problem.field else outer) for problem in self.problems
        )


@dataclass
class ProblemCollector:
    """Gathers the faults of several steps, so that one that fails does not hide what is wrong elsewhere."""

    problems: list[Problem] = field(default_factory=list)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Note the faults of a ConfigurationError that the body raises, and go on behind it."""
        try:
            yield
        except ConfigurationError as error:
            self.problems += error.problems

    def raise_if_any(self) -> None:
        """Raise ConfigurationError with all that was gathered, each once, those of a file in the order of its lines."""
        if self.problems:
            place = {source: at for at, source in enumerate(dict.fromkeys(one.source for one in self.problems))}
            once = dict.fromkeys(self.problems)
            raise ConfigurationError(sorted(once, key=lambda one: (place[one.source], one.line or 0)))
