"""Suites: many tasks, how often each shall succeed and how exactly, and controls that shall fail."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from bestman_bt.configuration import (
    ConfigurationError,
    Document,
    Problem,
    RunConfig,
    check,
    data_names,
    find_data,
    load_run,
    read_document,
)
from bestman_bt.configuration.quantity import Factor, Number, WholeNumber
from bestman_bt.evaluation.episode import prepare_episode

Count = Annotated[int, Field(strict=True, ge=1)]


@dataclass(frozen=True)
class Successes:
    """At least, or at most, so many ``of`` so many; of another number of runs the same share."""

    of: Count
    at_least: WholeNumber | None = None
    at_most: WholeNumber | None = None


@dataclass(frozen=True)
class Spread:
    """The largest median and 95th percentile of a metric that are accepted, in the metric's unit."""

    median: Number | None = None
    p95: Number | None = None


@dataclass(frozen=True)
class EntryConfig:
    """One task of a suite.

    ``task``: its name or file; without it the entry's own name. ``tree``: in the place of the task's own.
    ``settings``: ``key=value``, as ``--set``. Files are sought beside the suite's file first.
    ``episodes``: None takes the suite's. ``accuracy``: metric → limits, over the runs whose tree reported success.
    ``real_time_factor``: at least, per process.
    """

    successes: Successes
    task: str | None = None
    tree: str | None = None
    settings: tuple[str, ...] = ()
    episodes: Count | None = None
    accuracy: Mapping[str, Spread] = field(default_factory=dict)
    real_time_factor: Factor | None = None
    plugins: tuple[str, ...] = ()


@dataclass(frozen=True)
class SuiteConfig:
    """A file of ``configs/evaluations``: ``tasks`` that shall succeed, ``controls`` that shall not."""

    tasks: Mapping[str, EntryConfig]
    controls: Mapping[str, EntryConfig] = field(default_factory=dict)
    first_seed: WholeNumber = 7000
    episodes: Count = 20
    description: str = ""


@dataclass(frozen=True)
class Entry:
    """What is run and asked of one line of a suite: seeds ``config.seed`` … ``config.seed + episodes - 1``."""

    name: str
    config: RunConfig
    episodes: int
    asked: EntryConfig | None = None
    control: bool = False

    def configs(self) -> list[RunConfig]:
        """One per episode."""
        return [replace(self.config, seed=self.config.seed + i) for i in range(self.episodes)]


@dataclass(frozen=True)
class Suite:
    """Entries in their order."""

    name: str
    entries: tuple[Entry, ...]
    description: str = ""


def is_suite(name: str) -> bool:
    """Whether it names a suite: a shipped one, or a file that holds ``tasks``."""
    if Path(name).suffix == ".yaml" and Path(name).is_file():
        return "tasks" in read_document(Path(name)).data
    return name in data_names("evaluation")


def load_suite(
    name: str | Path, episodes: int | None = None, first_seed: int | None = None, settings: Iterable[str] = ()
) -> Suite:
    """Read a suite and everything that its entries name; raises ConfigurationError with all problems.

    ``episodes``, ``first_seed``: instead of the suite's own; entries with their own number keep it.
    """
    path = find_data("evaluation", name)
    document = read_document(path)
    asked = check(document, SuiteConfig)
    problems = list(_contradictions(document, asked))
    seed = asked.first_seed if first_seed is None else first_seed
    entries = []
    for kind, of_kind in (("tasks", asked.tasks), ("controls", asked.controls)):
        for key, entry in of_kind.items():
            try:
                config = load_run(
                    _beside(path, entry.task or key),
                    tree=None if entry.tree is None else _beside(path, entry.tree),
                    seed=seed,
                    settings=(*entry.settings, *settings),
                    plugins=[_beside(path, plugin) for plugin in entry.plugins],
                )
                prepare_episode(config)
            except ConfigurationError as error:
                problems += error.within(kind, key).problems
                continue
            number = entry.episodes or episodes or asked.episodes
            entries.append(Entry(key, config, number, entry, kind == "controls"))
    if problems:
        raise ConfigurationError(problems)
    return Suite(Path(name).stem, tuple(entries), asked.description)


def _beside(suite: Path, name: str) -> str:
    """The file of that name beside the suite's, if there is one; else the name as it is."""
    file = suite.parent / name
    return str(file) if file.is_file() else name


def _contradictions(document: Document, asked: SuiteConfig) -> Iterable[Problem]:
    """What types cannot tell."""
    if not asked.tasks:
        yield document.problem(("tasks",), "should name at least one task")
    for kind, entries in (("tasks", asked.tasks), ("controls", asked.controls)):
        for key, entry in entries.items():
            path = (kind, key, "successes")
            if (entry.successes.at_least is None) == (entry.successes.at_most is None):
                yield document.problem(path, "one of 'at_least' and 'at_most' should be given")
            elif max(entry.successes.at_least or 0, entry.successes.at_most or 0) > entry.successes.of:
                yield document.problem(path, f"more than all {entry.successes.of} are asked")
        for key in set(asked.tasks) & set(asked.controls) if kind == "controls" else ():
            yield document.problem((kind, key), "is the name of a task of this suite, too")
