"""Suites: many tasks, how often each shall succeed and how exactly, and controls that shall fail."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated

from pydantic import Field

from bestman_bt.configuration import (
    ConfigurationError,
    Document,
    Problem,
    ProblemCollector,
    RunConfig,
    RunRequest,
    beside,
    data_names,
    find_data,
    read_document,
    run_of_options,
)
from bestman_bt.configuration.checked import salvage
from bestman_bt.configuration.quantity import Factor, WholeNumber
from bestman_bt.configuration.secret import may_tell_secret
from bestman_bt.engine import TreeLoadError
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.facts.goals.goal import metric_names
from bestman_bt.registry import suggestion
from bestman_bt.runtime.failure_lines import RENAMED_CODES
from bestman_bt.runtime.setup import tree_problems
from bestman_bt.scene import SceneError

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

    median: Factor | None = None
    p95: Factor | None = None


@dataclass(frozen=True)
class EntryConfig:
    """One task of a suite.

    ``successes``: without them an entry may fail as often as it does; a control has to say them.
    ``task``: its name or file; without it the entry's own name. ``tree``: in the place of the task's own.
    ``settings``: ``key=value``, as ``--set``. Paths are counted from the suite's file.
    ``causes``: of a control, the error codes that its failures may have; none: any.
    ``episodes``: None takes the suite's. ``accuracy``: metric → limits, over the runs whose tree reported success.
    ``real_time_factor``: at least, per process.
    """

    successes: Successes | None = None
    task: str | None = None
    tree: str | None = None
    settings: tuple[str, ...] = ()
    episodes: Count | None = None
    accuracy: Mapping[str, Spread] = field(default_factory=dict)
    real_time_factor: Factor | None = None
    plugins: tuple[str, ...] = ()
    causes: tuple[str, ...] = ()


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

    @property
    def settings(self) -> dict[str, str]:
        """What it lays over its task, as ``--set`` names it: settings, and another tree and plug-ins; no secrets."""
        asked = self.asked or EntryConfig()
        given = dict(setting.partition("=")[::2] for setting in asked.settings)
        if asked.tree is not None:
            given["tree"] = asked.tree
        if asked.plugins:
            given["plugins"] = ", ".join(asked.plugins)
        return {key.strip(): "…" if may_tell_secret(key) else value.strip() for key, value in given.items()}

    def configs(self) -> list[RunConfig]:
        """One per episode."""
        entry = self.name if self.asked is not None else ""
        return [replace(self.config, seed=self.config.seed + i, entry=entry) for i in range(self.episodes)]


@dataclass(frozen=True)
class Suite:
    """Entries in their order."""

    name: str
    entries: tuple[Entry, ...]
    description: str = ""
    file: str = ""
    """The file of a user that it was read from; empty of a shipped suite, and where it was made of tasks."""


def is_suite(name: str) -> bool:
    """Whether it names a suite: a shipped one, or a file that holds ``tasks`` or ``controls``, or nothing at all."""
    if Path(name).suffix == ".yaml" and Path(name).is_file():
        data = read_document(Path(name)).data
        return not data or bool({"tasks", "controls"} & set(data))
    return name in data_names("evaluation")


def make_suite(
    tasks: Sequence[str],
    episodes: int | None,
    seed: int | None,
    asked: RunRequest,
) -> Suite:
    """The suite that is named, or one made of the tasks, which asks that all episodes succeed.

    ``asked``: what holds for each run, without its task and seed.
    """
    suites = [name for name in tasks if is_suite(name)]
    if suites and (len(tasks) > 1 or asked.scene or asked.robot or asked.plugins):
        message = "is a suite: no other task, scene, robot or plug-in can be given with it"
        raise ConfigurationError([Problem(suites[0], None, "", message)])
    if suites:
        return load_suite(suites[0], episodes, seed, asked.settings or ())
    entries = []
    faults = ProblemCollector()
    for name in dict.fromkeys(tasks):
        suite = get_close_matches(name, data_names("evaluation"), 1)
        if suite and name not in data_names("task") and not Path(name).exists():
            faults.problems.append(Problem(name, None, "", f"unknown; did you mean the suite {suite[0]!r}?"))
            continue
        with faults.step():
            entries.append(Entry(name, _config(replace(asked, task=name, seed=seed or 0)), episodes or 10))
    faults.raise_if_any()
    file = str(Path(tasks[0]).resolve()) if len(entries) == 1 and Path(tasks[0]).is_file() else ""
    return Suite("+".join(Path(name).stem for name in dict.fromkeys(tasks)), tuple(entries), file=file)


def _config(asked: RunRequest) -> RunConfig:
    """Everything of the task is checked; ConfigurationError tells all that is wrong."""
    known = list[Problem]()
    config = run_of_options(asked, known)
    prepare_episode(config, known)
    return config


def load_suite(
    name: str | Path, episodes: int | None = None, first_seed: int | None = None, settings: Iterable[str] = ()
) -> Suite:
    """Read a suite and everything that its entries name; raises ConfigurationError with all problems.

    ``episodes``, ``first_seed``: instead of the suite's own; entries with their own number keep it.
    """
    path = find_data("evaluation", name)
    document = read_document(path)
    faults = ProblemCollector()
    asked, faults.problems = salvage(document, SuiteConfig)
    if asked is not None:  # without what is wrong in it, which may now be missed
        wrong = [problem.field for problem in faults.problems]
        missed = _contradictions(document, asked)
        faults.problems += [one for one in missed if not any(field.startswith(one.field) for field in wrong)]
    seed = first_seed if first_seed is not None else asked.first_seed if asked is not None else 0
    entries = []
    for kind in ("tasks", "controls"):
        written = document.data.get(kind)
        for key in written if isinstance(written, dict) else ():
            try:  # where the suite has faults elsewhere, this entry's are told all the same
                entry, left_out = salvage(document.below(kind, key), EntryConfig)
            except TypeError:
                continue
            if entry is None or any(one.field.startswith(("task", "tree", "settings", "plugins")) for one in left_out):
                continue
            with faults.step():
                config = _prepared(path, Entered(document, kind, key, entry), seed, tuple(settings))
                number = entry.episodes or episodes or (asked.episodes if asked is not None else 1)
                entries.append(Entry(key, config, number, entry, kind == "controls"))
    faults.raise_if_any()
    own = "" if str(name) in data_names("evaluation") else str(path.resolve())
    return Suite(Path(name).stem, tuple(entries), asked.description if asked is not None else "", own)


@dataclass(frozen=True)
class Entered:
    """An entry where it is written."""

    document: Document
    kind: str
    key: str
    entry: EntryConfig

    def problem(self, field: tuple[str | int, ...], message: str) -> Problem:
        """A fault of a field of the entry."""
        return self.document.problem((self.kind, self.key, *field), message)

    def placed(self, problem: Problem) -> Problem:
        """A fault that a run was said to have, at the line of the suite where it was given; those of files stay."""
        if problem.line is not None:
            return problem
        fields: dict[str, tuple[str | int, ...]] = {"--tree": ("tree",)}
        option, _, value = problem.source.partition(" ")
        if self.entry.tree is not None and Path(problem.source).name == Path(self.entry.tree).name:
            option = "--tree"
        if option == "--set":
            keys = [setting.partition("=")[0].strip() for setting in self.entry.settings]
            key = value.partition("=")[0].strip()
            if key not in keys:  # it was given on the command line
                return problem
            fields["--set"] = ("settings", keys.index(key))
        elif option == "--plugin":
            names = [Path(plugin).name for plugin in self.entry.plugins]
            fields["--plugin"] = ("plugins", names.index(Path(value).name)) if Path(value).name in names else ()
        told = problem.message if not problem.field or option in fields else f"{problem.field}: {problem.message}"
        return self.problem(fields.get(option, ("task",) if self.entry.task else ()), told)


def _prepared(path: Path, entered: Entered, seed: int, settings: tuple[str, ...]) -> RunConfig:
    """The configuration of an entry's runs with everything checked; ConfigurationError names the suite's lines."""
    entry = entered.entry
    faults, wrong = ProblemCollector(), list[Problem]()
    try:
        asked = RunRequest(
            beside(path, "task", entry.task or entered.key),
            tree=None if entry.tree is None else beside(path, "tree", entry.tree),
            seed=seed,
            settings=(*entry.settings, *settings),
            plugins=[path.parent / plugin for plugin in entry.plugins],
        )
        config = run_of_options(asked, wrong)
        setup = prepare_episode(config, wrong)
        known = metric_names(setup.asked, config.task.predicates)
        faults.problems += [
            entered.problem(("accuracy", name), f"the task's judge measures no such thing; {suggestion(name, known)}")
            for name in entry.accuracy
            if name not in known
        ]
    except ConfigurationError as error:
        faults.problems += [entered.placed(problem) for problem in error.problems]
    except TreeLoadError as error:
        faults.problems += tree_problems(error)
    except SceneError as error:
        faults.problems.append(entered.problem((), str(error)))
    faults.raise_if_any()
    return config


def _contradictions(document: Document, asked: SuiteConfig) -> Iterable[Problem]:
    """What types cannot tell."""
    if not asked.tasks:
        yield document.problem(("tasks",), "should name at least one task")
    for kind, entries in (("tasks", asked.tasks), ("controls", asked.controls)):
        for key, entry in entries.items():
            path = (kind, key, "successes")
            if entry.successes is None:
                if kind == "controls":
                    yield document.problem(
                        path, "is missing: a control says how often it may succeed, {at_most: 0, of: 10}"
                    )
            elif (entry.successes.at_least is None) == (entry.successes.at_most is None):
                yield document.problem(path, "one of 'at_least' and 'at_most' should be given")
            elif max(entry.successes.at_least or 0, entry.successes.at_most or 0) > entry.successes.of:
                yield document.problem(path, f"more than all {entry.successes.of} are asked")
            if entry.causes and kind == "tasks":
                yield document.problem((kind, key, "causes"), "is for controls: a task shall not fail")
            for code in set(entry.causes) & set(RENAMED_CODES):
                message = f"nothing fails as {code!r}; it is called {RENAMED_CODES[code]!r} now"
                yield document.problem((kind, key, "causes"), message)
        for key in set(asked.tasks) & set(asked.controls) if kind == "controls" else ():
            yield document.problem((kind, key), "is the name of a task of this suite, too")
