"""Which entries of evaluations are compared with which, and what is told of that."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from bestman_bt.configuration import ConfigurationError, Problem
from bestman_bt.evaluation.comparison_text import sentences
from bestman_bt.evaluation.finished_evaluation import FinishedEntry
from bestman_bt.evaluation.paired_comparison import Comparison, compare_runs


@dataclass(frozen=True)
class ComparedEntries:
    """An entry and the one that it is compared with, under the names by which they are told apart."""

    first: FinishedEntry
    second: FinishedEntry
    names: tuple[str, str]

    @cached_property
    def comparison(self) -> Comparison:
        """The statistics; ConfigurationError where the two have no seed in common."""
        try:
            return compare_runs(self.first.results, self.second.results)
        except ValueError as error:
            raise ConfigurationError([Problem(" and ".join(self.names), None, "", str(error))]) from error

    def lines(self) -> Iterator[str]:
        """A section of Markdown: what was compared, and a sentence about success and each metric."""
        yield f"### {self.names[1]} against {self.names[0]}"
        yield ""
        for name, entry in zip(self.names, (self.first, self.second), strict=True):
            settings = ", ".join(f"{key}={value}" for key, value in entry.settings.items()) or "no settings of its own"
            yield f"- {name}: task {entry.task}, {settings}"
        yield ""
        yield from (f"- {sentence}" for sentence in sentences(self.comparison, *self.names))

    def document(self) -> dict[str, Any]:
        """For JSON."""
        sides = [
            {"name": name, "entry": entry.name, "task": entry.task, "settings": dict(entry.settings)}
            for name, entry in zip(self.names, (self.first, self.second), strict=True)
        ]
        told = sentences(self.comparison, *self.names)
        return {"first": sides[0], "second": sides[1], "sentences": told, **asdict(self.comparison)}

    def draw(self, path: Path) -> None:
        """Write the picture."""
        from bestman_bt.evaluation.comparison_picture import draw_comparison

        draw_comparison(path, self.comparison, *self.names)


def within(entries: Sequence[FinishedEntry]) -> list[ComparedEntries]:
    """Each entry with the first one of its task; where all are of different tasks, with the first of all."""
    firsts = {entry.task: entry for entry in reversed(entries)}
    compared = [(firsts[entry.task], entry) for entry in entries if entry is not firsts[entry.task]]
    compared = compared or [(entries[0], entry) for entry in entries[1:]]
    return [ComparedEntries(first, second, (first.name, second.name)) for first, second in compared]


def matched(
    firsts: Sequence[FinishedEntry], seconds: Sequence[FinishedEntry], given: tuple[str, str]
) -> list[ComparedEntries]:
    """The entries of one name, or the only two; ConfigurationError where nothing matches."""
    if len(firsts) == len(seconds) == 1:
        return [ComparedEntries(firsts[0], seconds[0], _told_apart(firsts[0].name, seconds[0].name, given))]
    by_name = {entry.name: entry for entry in seconds}
    pairs = [(entry, by_name[entry.name]) for entry in firsts if entry.name in by_name]
    if not pairs:
        names = ", ".join(entry.name for entry in firsts), ", ".join(entry.name for entry in seconds)
        message = f"no entry has the same name as one of {given[1]} ({names[0]}; {names[1]}): name one as FOLDER:ENTRY"
        raise ConfigurationError([Problem(given[0], None, "", message)])
    if len(pairs) == 1:
        ((one, other),) = pairs
        return [ComparedEntries(one, other, _told_apart(one.name, other.name, given))]
    folders = [_told_apart(one.name, other.name, given) for one, other in pairs]
    return [
        ComparedEntries(one, other, (f"{first}:{one.name}", f"{second}:{other.name}"))
        for (one, other), (first, second) in zip(pairs, folders, strict=True)
    ]


def _told_apart(first: str, second: str, given: tuple[str, str]) -> tuple[str, str]:
    """Names of entries, or of the folders where those are the same; ConfigurationError where these are, too."""
    if first != second:
        return first, second
    folders = [Path(side.rpartition(":")[0] if side.endswith(f":{first}") else side) for side in given]
    names = [folder.resolve().name for folder in folders]
    if folders[0].resolve() == folders[1].resolve():
        raise ConfigurationError([Problem(given[0], None, "", "is compared with itself: name another one")])
    return (names[0], names[1]) if names[0] != names[1] else (str(folders[0]), str(folders[1]))
