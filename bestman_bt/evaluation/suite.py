"""Suites: tasks with target success rates and accuracies, met or missed, and controls that must fail."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from behaviours.failure import declared_failures
from bestman_bt.configuration.checked import numbered, salvage
from bestman_bt.configuration.data import beside, data_names, find_data
from bestman_bt.configuration.document import Document, read_document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    UnreadError,
    up_to_unread_field,
)
from bestman_bt.configuration.quantity import Factor, WholeNumber
from bestman_bt.configuration.run import RunConfig, RunRequest, run_of_options
from bestman_bt.configuration.secret import is_secret_setting
from bestman_bt.engine import TreeLoadError
from bestman_bt.evaluation.episode import prepare_episode
from bestman_bt.evaluation.interval import Precision
from bestman_bt.extras import DEFAULT_SIMULATOR
from bestman_bt.facts.goals.goal import metric_names, read_goals
from bestman_bt.registry import suggestion
from bestman_bt.runtime.failure_lines import RENAMED_CODES
from bestman_bt.runtime.plugins import node_registry
from bestman_bt.runtime.resolved_config import ResolvedConfig, tree_problems
from bestman_bt.scene.draw import SceneError

Count = Annotated[int, Field(strict=True, ge=1)]


@dataclass(frozen=True)
class Successes:
    """A target of at least, or at most, this number of successes ``of`` a number of episodes; scaled to the actual
    number.
    """

    of: Count
    at_least: WholeNumber | None = None
    at_most: WholeNumber | None = None


@dataclass(frozen=True)
class Spread:
    """The largest accepted median and 95th percentile of a metric, in the metric's unit."""

    median: Factor | None = None
    p95: Factor | None = None


@dataclass(frozen=True)
class EntryConfig:
    """One task of a suite.

    ``successes``: optional for tasks, required for controls. ``task``: its name or file; by default the entry's name.
    ``tree``: replaces the task's tree. ``settings``: ``key=value``, as for ``--set``. Paths are relative to the suite's
    file. ``causes``: for a control, the error codes that its failures must have; empty: any. ``episodes``: None: the
    suite's. ``accuracy``: metric → limits, over the runs whose tree succeeded. ``real_time_factor``: smallest accepted
    value, per process.
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
    """A file of ``configs/evaluations``: ``tasks`` that should succeed, ``controls`` that must fail."""

    tasks: Mapping[str, EntryConfig]
    controls: Mapping[str, EntryConfig] = field(default_factory=dict)
    first_seed: WholeNumber = 7000
    episodes: Count = 20
    description: str = ""


@dataclass(frozen=True)
class SuiteEntry:
    """One entry with its runs: seeds ``config.seed`` … ``config.seed + episodes - 1``."""

    name: str
    config: RunConfig
    episodes: int
    asked: EntryConfig | None = None
    control: bool = False

    @property
    def settings(self) -> dict[str, str]:
        """The overrides of its task as for ``--set``: settings, tree and plug-ins; no secrets."""
        asked = self.asked or EntryConfig()
        given = dict(setting.partition("=")[::2] for setting in asked.settings)
        if asked.tree is not None:
            given["tree"] = asked.tree
        if asked.plugins:
            given["plugins"] = ", ".join(asked.plugins)
        return {key.strip(): "…" if is_secret_setting(key) else value.strip() for key, value in given.items()}

    def configs(self) -> list[RunConfig]:
        """Return one configuration per episode."""
        return [self.config_of(self.config.seed + i) for i in range(self.episodes)]

    def config_of(self, seed: int) -> RunConfig:
        """Return the configuration of one episode."""
        return replace(self.config, seed=seed, entry=self.name if self.asked is not None else "")


@dataclass(frozen=True)
class Suite:
    """The entries of an evaluation, in their order."""

    name: str
    entries: tuple[SuiteEntry, ...]
    description: str = ""
    file: str = ""
    """The user's file of the suite; empty for shipped suites and for suites of single tasks."""
    precision: Precision | None = None
    """Required precision of each success rate; ``episodes`` is then the maximum. None: all episodes run."""


def is_suite(name: str) -> bool:
    """Return whether ``name`` refers to a suite: a shipped one, or a file with ``tasks`` or ``controls``, or an empty
    file.
    """
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
    """Return the named suite, or one of the given tasks, which must all succeed.

    ``asked``: common options of all runs, without task and seed. Raises ConfigurationError.
    """
    suites = [name for name in tasks if is_suite(name)]
    if suites and (len(tasks) > 1 or asked.scene or asked.robot or asked.plugins):
        message = "is a suite: no other task, scene, robot or plug-in can be given with it"
        raise ConfigurationError([Problem(suites[0], None, "", message)])
    if suites:
        return load_suite(suites[0], episodes, seed, asked.settings or (), asked.driver)
    entries = []
    faults = ProblemCollector()
    for name in dict.fromkeys(tasks):
        suite = get_close_matches(name, data_names("evaluation"), 1)
        if suite and name not in data_names("task") and not Path(name).exists():
            faults.problems.append(Problem(name, None, "", f"unknown; did you mean the suite {suite[0]!r}?"))
            continue
        with faults.step():
            entries.append(SuiteEntry(name, _config(replace(asked, task=name, seed=seed or 0)), episodes or 10))
    faults.raise_if_any()
    file = str(Path(tasks[0]).resolve()) if len(entries) == 1 and Path(tasks[0]).is_file() else ""
    return Suite("+".join(Path(name).stem for name in dict.fromkeys(tasks)), tuple(entries), file=file)


def _config(asked: RunRequest) -> RunConfig:
    """Check the whole task. Raises ConfigurationError listing every fault."""
    known = list[Problem]()
    config = run_of_options(asked, known)
    prepare_episode(config, known)
    return config


def load_suite(
    name: str | Path,
    episodes: int | None = None,
    first_seed: int | None = None,
    settings: Iterable[str] = (),
    driver: str = DEFAULT_SIMULATOR,
) -> Suite:
    """Read a suite and all files named by its entries. Raises ConfigurationError listing every fault.

    ``episodes``, ``first_seed``: override those of the suite; entries with their own number keep it. ``driver``: the
    simulation driver.
    """
    path = find_data("evaluation", name)
    document = read_document(path)
    faults = ProblemCollector()
    asked, faults.problems = salvage(document, SuiteConfig)
    wrong = [problem.field for problem in faults.problems]  # left out in what is asked, and then missed there
    faults.problems += [
        one for one in _contradictions(document, asked) if not any(field.startswith(one.field) for field in wrong)
    ]
    seed = first_seed if first_seed is not None else asked.first_seed
    entries = []
    for kind in ("tasks", "controls"):
        for key, entry in _read_entries(asked, kind).items():
            if {f"{kind}.{key}.task", f"{kind}.{key}.plugins"} & {field.partition("[")[0] for field in wrong}:
                continue  # the run is not known
            with faults.step():
                config = _prepared(path, LocatedEntry(document, kind, key, entry), seed, tuple(settings), driver)
                number = entry.episodes or episodes or asked.episodes
                entries.append(SuiteEntry(key, config, number, entry, kind == "controls"))
    faults.raise_if_any()
    own = "" if str(name) in data_names("evaluation") else str(path.resolve())
    return Suite(Path(name).stem, tuple(entries), asked.description, own)


def _read_entries(asked: SuiteConfig, kind: str) -> Mapping[str, EntryConfig]:
    try:
        entries: Mapping[str, EntryConfig] = getattr(asked, kind)
    except UnreadError:
        return {}
    return entries


@dataclass(frozen=True)
class LocatedEntry:
    """An entry with its place in the file."""

    document: Document
    kind: str
    key: str
    entry: EntryConfig

    def problem(self, field: tuple[str | int, ...], message: str) -> Problem:
        """Return a fault of a field of the entry."""
        return self.document.problem((self.kind, self.key, *field), message)

    def placed(self, problem: Problem) -> Problem:
        """Return a fault of a run at the line of the suite that caused it; faults with a file are unchanged."""
        if problem.line is not None:
            return problem
        fields: dict[str, tuple[str | int, ...]] = {"--tree": ("tree",)}
        option, _, value = problem.source.partition(" ")
        if self.entry.tree is not None and Path(problem.source).name == Path(self.entry.tree).name:
            option = "--tree"
        if option == "--set":
            keys = {setting.partition("=")[0].strip(): index for index, setting in numbered(self.entry.settings)}
            key = value.partition("=")[0].strip()
            if key not in keys:  # it was given on the command line
                return problem
            fields["--set"] = ("settings", keys[key])
        elif option == "--plugin":
            names = [Path(plugin).name for plugin in self.entry.plugins]
            fields["--plugin"] = ("plugins", names.index(Path(value).name)) if Path(value).name in names else ()
        field = fields.get(option, ("task",) if self.entry.task else ())
        told = problem.message if not problem.field or option in fields else f"{problem.field}: {problem.message}"
        written = self._written(field) if field else None
        if isinstance(written, str) and written.partition("=")[0] not in told:
            told += f", got {written!r}"
        return self.problem(field, told)

    def _written(self, field: tuple[str | int, ...]) -> Any:
        value: Any = self.document.data[self.kind][self.key]
        for key in field:
            value = value[key]
        return value


def _prepared(path: Path, entered: LocatedEntry, seed: int, settings: tuple[str, ...], driver: str) -> RunConfig:
    """Return the checked configuration of an entry's runs.

    Raises ConfigurationError naming the suite's lines.
    """
    entry = entered.entry
    faults, wrong = ProblemCollector(), list[Problem]()
    config: RunConfig | None = None
    setup: ResolvedConfig | None = None
    try:
        asked = RunRequest(
            beside(path, "task", entry.task or entered.key),
            tree=None if entry.tree is None else beside(path, "tree", entry.tree),
            seed=seed,
            settings=(*entry.settings, *settings),
            plugins=[path.parent / plugin for plugin in entry.plugins],
            driver=driver,
        )
        config = run_of_options(asked, wrong)
        setup = prepare_episode(config, wrong)
    except SceneError as error:
        faults.problems += [one if one.line else entered.problem((), str(one)) for one in error.problems]
    except ConfigurationError as error:
        faults.problems += [entered.placed(problem) for problem in error.problems]
    except TreeLoadError as error:
        faults.problems += tree_problems(error)
    if config is not None:
        faults.problems += _unmeasured(entered, config, setup)
        faults.problems += _unknown_causes(entered, config)
    faults.raise_if_any()
    assert config is not None
    return config


def _unmeasured(entered: LocatedEntry, config: RunConfig, setup: ResolvedConfig | None) -> Iterator[Problem]:
    """Yield a problem for each metric that the task's judge does not measure."""
    if setup is not None:
        known = metric_names(setup.asked, config.task.predicates)
    else:  # it is not known how many things the goals are about
        kinds = [kind for kind, _, _ in read_goals(config, [])]
        known = [name for kind in kinds for one in config.task.predicates for name in kind.measures.get(one, ())]
    for name in entered.entry.accuracy if known or setup is not None else ():
        if name not in known and (setup is not None or not name.startswith(tuple(known))):
            message = f"the task's judge has no such metric; {suggestion(name, known)}"
            yield entered.problem(("accuracy", name), message)


def _unknown_causes(entered: LocatedEntry, config: RunConfig) -> Iterator[Problem]:
    """Yield a problem for each code with which no node fails."""
    if not entered.entry.causes:
        return
    try:
        registry = node_registry(config.task.plugins)
    except ConfigurationError:
        return
    known = {code for info in registry for code in declared_failures(info.cls)}
    for index, code in numbered(entered.entry.causes):
        if code not in known and code not in RENAMED_CODES:
            message = f"no node fails with {code!r}; {suggestion(code, list(known))}"
            yield entered.problem(("causes", index), message)


def _contradictions(document: Document, asked: SuiteConfig) -> Iterable[Problem]:
    """Return the faults that types cannot express."""
    if document.data.get("tasks") == {}:
        yield document.problem(("tasks",), "should name at least one task")
    for kind in ("tasks", "controls"):
        for key, entry in _read_entries(asked, kind).items():
            yield from _successes_faults(document, kind, key, entry)
            if entry.causes and kind == "tasks":
                yield document.problem((kind, key, "causes"), "is for controls only: a task should not fail")
            for code in set(entry.causes) & set(RENAMED_CODES):
                message = f"no node fails with {code!r}; it is called {RENAMED_CODES[code]!r} now"
                yield document.problem((kind, key, "causes"), message)
    for key in _read_entries(asked, "controls").keys() & _read_entries(asked, "tasks").keys():
        yield document.problem(("controls", key), "is also the name of a task of this suite")


@up_to_unread_field
def _successes_faults(document: Document, kind: str, key: str, entry: EntryConfig) -> Iterator[Problem]:
    path, asked = (kind, key, "successes"), entry.successes
    if asked is None and kind == "controls":
        yield document.problem(
            path, "is missing: a control needs the number of successes that it may have, {at_most: 0, of: 10}"
        )
    elif asked is not None and (asked.at_least is None) == (asked.at_most is None):
        yield document.problem(path, "one of 'at_least' and 'at_most' should be given")
    elif asked is not None and max(asked.at_least or 0, asked.at_most or 0) > asked.of:
        yield document.problem(path, f"exceeds the number of episodes, {asked.of}")


ALWAYS_ASKED = ("errors", "false successes", "audit")
"""Targets that every entry of a suite has; they do not count as targets of the entry."""


@dataclass(frozen=True)
class Target:
    """One target as text: ``what``, the target ``asked`` and the value ``found``."""

    what: str
    asked: str
    found: str
    met: bool


def check_targets(asked: EntryConfig, summary: dict[str, Any]) -> list[Target]:
    """Compare the output of ``summarize`` with the targets of an entry.

    Implied targets: no errors, no false success and a clean audit.
    """
    return list(_targets(asked, summary))


def _targets(asked: EntryConfig, summary: dict[str, Any]) -> Iterator[Target]:
    wanted, succeeded, episodes = asked.successes, summary["succeeded"], summary["episodes"]
    found = f"{succeeded} of {episodes}"
    if wanted is not None and wanted.at_least is not None:
        met = episodes > 0 and succeeded * wanted.of >= wanted.at_least * episodes
        yield Target("successes", f"≥ {wanted.at_least} of {wanted.of}", found, met)
    if wanted is not None and wanted.at_most is not None:
        met = episodes > 0 and succeeded * wanted.of <= wanted.at_most * episodes
        yield Target("successes", f"≤ {wanted.at_most} of {wanted.of}", found, met)
    for metric, limits in asked.accuracy.items():
        for statistic, limit in (("median", limits.median), ("p95", limits.p95)):
            if limit is not None:
                measured = summary["accuracy"].get(metric)
                value = measured[statistic] if measured else None
                told = f"{value:.2f}" if value is not None else "not measured"
                yield Target(f"{metric} {statistic}", f"≤ {limit:g}", told, value is not None and value <= limit)
    if asked.real_time_factor is not None:
        factor = summary["real_time_factor"]
        yield Target(
            "real-time factor", f"≥ {asked.real_time_factor:g}", f"{factor:.1f}", factor >= asked.real_time_factor
        )
    if asked.causes:
        other = [f"{count} {code}" for code, count in summary["causes"].items() if code not in asked.causes]
        found = ", ".join(other) or "no other"
        yield Target("causes", f"only {', '.join(asked.causes)}", found, not other)
    yield Target("errors", "0", str(summary["errors"]), summary["errors"] == 0)
    false = summary["false_successes"]
    yield Target("false successes", "0", str(false), false == 0)
    clean = summary["audit_clean"]
    yield Target("audit", "clean", "clean" if clean else f"seeds {summary['unclean_seeds']}", clean)
