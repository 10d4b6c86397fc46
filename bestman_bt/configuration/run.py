"""The merged configuration of one run: task, seed and settings; it can be dumped to YAML and read back unchanged."""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from bestman_bt.configuration.checked import check, override
from bestman_bt.configuration.data import find_data
from bestman_bt.configuration.document import Document, FieldPath, Origins, parse_value, read_document
from bestman_bt.configuration.errors import (
    ConfigurationError,
    Problem,
    ProblemCollector,
    in_python,
    naming_python_parameters,
)
from bestman_bt.configuration.quantity import Seed
from bestman_bt.configuration.secret import shown_setting
from bestman_bt.configuration.task import TaskConfig, check_task, task_document, with_default_algorithms
from bestman_bt.extras import DEFAULT_SIMULATOR

_SECRET = re.compile(r"connections(\.[^.]+(\.(address|token))?)?")

_NAMED_FILE = re.compile(r"(.+\.\w+)((?<=\.py):\w+)?")


@dataclass(frozen=True)
class RunConfig:
    """The complete configuration of a run.

    ``name``: for results and folders; the task's, or that of the tree that replaces the task's. ``scene_settings``,
    ``robot_settings``: dotted keys → values for ``load_scene`` and ``load_robot_model``. ``driver``: the implementation
    of the Robotics API. ``recording``: the run folder that the driver ``replay`` plays. ``entry``: the suite entry of
    the run; has no effect on it. ``confirm``: ask a person before each motion. ``search``: folders with SubTrees of the
    tree. ``pretend``: simulate leaves without code, by the file ``scenario`` or at random. ``watch``: apply changes of
    the tree's files while it runs. ``written``: the task as written, for messages; not part of the run.
    """

    name: str
    task: TaskConfig
    seed: Seed = 0
    driver: str = DEFAULT_SIMULATOR
    record: bool = False
    recording: str = ""
    scene_settings: Mapping[str, Any] = field(default_factory=dict)
    robot_settings: Mapping[str, Any] = field(default_factory=dict)
    entry: str = ""
    written: Document = field(default_factory=lambda: Document({}), init=False, repr=False, compare=False)
    confirm: bool = False
    search: tuple[str, ...] = ()
    pretend: bool = False
    scenario: str = ""
    watch: bool = False

    def changed(self, **fields: Any) -> RunConfig:
        """Return a copy with other values of these fields."""
        return _remembering(dataclasses.replace(self, **fields), self.written)

    def problem(self, path: FieldPath, message: str) -> Problem:
        """Return a fault of the task's field at ``path``, with the file and line, or the option, that set it."""
        origins = {(): (f"task {self.name}", None), **self.written.origins}
        return Document({}, origins).problem(path, message)


@dataclass(frozen=True)
class RunRequest:
    """A request for a run, from options or arguments, unchecked.

    ``settings``: ``key=value``; ``scene.…`` and ``robot.…`` set those, other keys the task. ``driver``: the
    implementation of the Robotics API. ``name``: the run's name, by default the task's.
    """

    task: str | Path | None = None
    tree: str | Path | None = None
    scene: str | Path | None = None
    robot: str | Path | None = None
    seed: int = 0
    settings: Iterable[str] | None = ()
    plugins: Iterable[str | Path] | None = ()
    record: bool = False
    driver: str = DEFAULT_SIMULATOR
    name: str = ""


def load_run(  # noqa: PLR0913 - the arguments of a run, each by its name
    task: str | Path | None = None,
    *,
    tree: str | Path | None = None,
    scene: str | Path | None = None,
    robot: str | Path | None = None,
    seed: int = 0,
    settings: Iterable[str] = (),
    plugins: Iterable[str] = (),
    record: bool = False,
    driver: str = DEFAULT_SIMULATOR,
) -> RunConfig:
    """Merge a task (or, without one, a tree, a scene and a robot) with the other arguments.

    The arguments are the fields of ``RunRequest``. Without a task and a tree, the run's ``tree`` is empty; the session
    receives its trees later. Raises ConfigurationError, which names arguments; scene and robot settings are checked
    when those are loaded.
    """
    with naming_python_parameters():
        run = run_of_options(RunRequest(task, tree, scene, robot, seed, settings, plugins, record, driver))
    origins = {path: (in_python(source), line) for path, (source, line) in run.written.origins.items()}
    return _remembering(run, dataclasses.replace(run.written, origins=origins))


def run_of_options(asked: RunRequest, faults: list[Problem] | None = None) -> RunConfig:
    """Merge like ``load_run``, for the command line: errors name its options.

    With ``faults``, faults are added there and invalid parts omitted if the rest can be checked further: a missing
    tree, scene or robot is empty.
    """
    task = asked.task
    tree = "" if asked.tree is None and task is None else asked.tree
    choices = {"tree": tree, "scene": asked.scene, "robot": asked.robot}
    source = {key: str(value) for key, value in choices.items() if value is not None}
    origins: Origins = {(key,): (value if key == "tree" else f"--{key} {value}", None) for key, value in source.items()}
    command_line = Document(dict(source), origins)
    found = ProblemCollector()
    document, known, given = with_default_algorithms(_nothing()), False, [str(plugin) for plugin in asked.plugins or ()]
    values: dict[str, Any] = {}
    with found.step():
        document = document if task is None else task_document(task, found.problems)
        known = True
    document = document.merged(command_line)
    for setting in asked.settings or ():
        with found.step():
            values |= parse_settings([setting])
    inner = {kind: _below(values, kind) for kind in ("scene", "robot")}
    merged: TaskConfig | None = None
    for key, value in values.items():
        if not key.startswith(("scene.", "robot.")):
            with found.step():
                document = override(document, TaskConfig, {key: value})
    if known:
        with found.step():
            merged = check_task(document, found.problems)
    absent: dict[str, Any] = {}
    for kind in choices:
        with found.step():
            named = document.data.get(kind)
            if isinstance(named, str) and named:
                asked_by = document.problem((kind,), "")
                absent[kind] = ""
                find_data(kind, named, dataclasses.replace(asked_by, field="") if kind in source else asked_by)
                del absent[kind]
    given_seed, seed = Document({"seed": asked.seed}, {("seed",): (f"--seed {asked.seed}", None)}), 0
    with found.step():
        seed = check(given_seed, _Seed).seed
    if faults is not None:
        faults += found.problems
    if merged is None or (found.problems and faults is None):  # otherwise plug-ins are told of where they are loaded
        found.problems += [Problem(f"--plugin {p}", None, "", "no such file") for p in given if not Path(p).is_file()]
        found.raise_if_any()
    assert merged is not None
    merged = dataclasses.replace(merged, plugins=(*merged.plugins, *given), **absent)
    name = asked.name or Path(str(merged.tree if task is None else task)).stem or "session"
    run = RunConfig(name, merged, seed, asked.driver, asked.record, "", inner["scene"], inner["robot"])
    if not found.problems:  # otherwise it knows which entries of lists were left out
        run = check(Document(_plain(run), {(): ("the run", None)}), RunConfig)
    return _remembering(run, document)


@dataclass(frozen=True)
class _Seed:
    seed: Seed


def parse_settings(settings: Iterable[str]) -> dict[str, Any]:
    """Return ``key=value`` texts as a mapping with YAML scalars. Raises ConfigurationError."""
    values: dict[str, Any] = {}
    problems: list[Problem] = []
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not equals or not key.strip():
            problems.append(Problem(shown_setting(setting), None, "", "should have the form key=value"))
            continue
        try:
            values[key.strip()] = parse_value(value)
        except ValueError as error:
            problems.append(Problem(shown_setting(setting), None, "", str(error)))
    if problems:
        raise ConfigurationError(problems)
    return values


def dump_run(run: RunConfig, absolute: bool = False) -> str:
    """Return the run as YAML text, SI numbers; without the addresses and tokens of controllers.

    ``absolute``: make paths relative to the working directory absolute, so that the text can be read anywhere.
    """
    document = _plain(run)
    if absolute:
        document = _absolute(document) | {"recording": run.recording and str(Path(run.recording).resolve())}
    settings = document["robot_settings"]
    document["robot_settings"] = {key: value for key, value in settings.items() if not _SECRET.fullmatch(key)}
    text: str = yaml.safe_dump(document, sort_keys=False, allow_unicode=True)
    return text


def read_run(path: Path) -> RunConfig:
    """Read a file of ``dump_run``. Raises ConfigurationError."""
    document = read_document(path)
    run = check(document, RunConfig)
    task = document.below("task")
    check_task(task)
    return _remembering(run, task)


def _absolute(value: Any) -> Any:
    """Replace texts that name a file, ``mine.yaml`` or ``mine.py:MyPlanner``, by the absolute path; keep all others."""
    if isinstance(value, dict):
        return {key: _absolute(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_absolute(item) for item in value]
    if isinstance(value, str) and (match := _NAMED_FILE.fullmatch(value)) and Path(match[1]).is_file():
        return str(Path(match[1]).resolve()) + (match[2] or "")
    return value


def _remembering(run: RunConfig, written: Document) -> RunConfig:
    object.__setattr__(run, "written", written)
    return run


def _nothing() -> Document:
    return Document({}, {(): ("command line", None)})


def _below(values: Mapping[str, Any], kind: str) -> dict[str, Any]:
    return {key.removeprefix(f"{kind}."): value for key, value in values.items() if key.startswith(f"{kind}.")}


def _plain(value: Any) -> Any:
    """Convert dataclasses, mappings and tuples to dictionaries and lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _plain(getattr(value, f.name)) for f in dataclasses.fields(value) if f.init}
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return copy.copy(value)
