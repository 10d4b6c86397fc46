"""Reader of a run folder in any state, for reports."""

from __future__ import annotations

import io
import json
import socket
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml
from PIL import Image, UnidentifiedImageError

from bestman_bt.errors import Error, InputError
from bestman_bt.evaluation.report.stop_chart import StopChart, stop_chart
from bestman_bt.evaluation.result import RunResult
from bestman_bt.messages.black_box import PATTERN, BlackBox, BlackBoxError
from bestman_bt.records.events import LogEvent
from bestman_bt.records.history import Picture, RunHistory
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.reader import LARGEST_RESULT, RecordError, has_record, is_log, read, read_result, run_folders
from bestman_bt.records.timeline import Activities, activities
from bestman_bt.records.writer import CONFIG_FILE, EVENTS_FILE, LOG_FILE, RESULT_FILE, STATES_FILE

DEPTH = 4
"""Depth of folders searched for runs below the given one."""
PARTS = (RESULT_FILE, CONFIG_FILE, STATES_FILE, EVENTS_FILE, LOG_FILE)
MAX_BYTES = {RESULT_FILE: LARGEST_RESULT, CONFIG_FILE: 256_000}
LEFT_OUT = ("blackboard", "map", "path", "robot", "scan")
"""Events that a report omits."""
LONGEST_TEXT = 200
MAX_FAILURES = 200
MAX_PICTURES = 50
MAX_STOPS = 20
NAMED_PICTURES = ("start", "grasp", "end")
MAX_FILE, MAX_PIXELS = 16_000_000, 30_000_000
"""Limits of a picture: bytes of its file, and pixels."""
WIDTH, QUALITY = 640, 78
SAME_MOMENT = 0.5
"""Largest time between a failure and its picture, seconds."""


class ReportError(InputError):
    """A folder is not a run folder, or its report cannot be made."""


def folders_to_report(given: Path) -> list[Path]:
    """Return the run folders of a path. Raises ReportError if there is none."""
    found = run_folders(given, PARTS, DEPTH)
    if not found and not given.is_dir():
        raise ReportError(f"{given} is not a folder")
    if not found:
        raise ReportError(f"{given} is not a run folder and contains none: none has {' or '.join(PARTS)}")
    return found


def read_run_report(folder: Path) -> RunReport:
    """Return the report data of the files in ``folder``; damaged parts are omitted and noted.

    Raises ReportError if nothing can be read.
    """
    notes: list[str] = []
    result: RunResult | None = _part(
        folder, RESULT_FILE, lambda path: RunResult.from_document(read_result(path.parent)), notes
    )
    config: str = _part(folder, CONFIG_FILE, lambda path: path.read_text(encoding="utf-8"), notes) or ""
    about: dict[str, Any] = _part(folder, CONFIG_FILE, lambda path: _read_about(config), notes if config else []) or {}
    history = RunHistory()
    if has_record(folder) or is_log(folder):
        try:
            history = read(folder, LEFT_OUT)
        except RecordError as error:
            notes.append(_short(error))
    notes += history.faults
    if result is None and not config and not history.version:
        raise ReportError(f"{folder}: {'; '.join(notes) or 'it does not contain a run'}")
    task = about.get("task") if isinstance(about.get("task"), dict) else {}
    end = history.end["time"] if history.end else 0.0
    name = _text(about.get("name") or history.about.get("task")) or folder.name
    return RunReport(
        folder=folder,
        task=result.task if result is not None else name,
        seed=result.seed if result is not None else _number(about.get("seed")),
        robot=_text(task.get("robot") if task else ""),
        scene=_text(task.get("scene") if task else ""),
        entry=_text(about.get("entry")),
        settings=_settings(about),
        outcome=_outcome(folder, result, history),
        started=history.about.get("started"),
        duration=max(result.sim_time_s, end) if result is not None else history.last,
        result=result,
        config=config,
        nodes=history.nodes,
        activities=activities(history.states.changes(), history.last),
        failures=tuple(_failures(folder, result, history, notes)),
        pictures=tuple(_pictures(folder, notes)),
        stops=tuple(_stops(folder, notes)),
        notes=tuple(notes),
        source=_text(history.about.get("source")),
    )


def _part(folder: Path, name: str, read_part: Callable[[Path], Any], notes: list[str]) -> Any:
    """Return the content of a file; None, and a note, if it cannot be read."""
    path = folder / name
    if not path.is_file():
        return None
    try:
        size = path.stat().st_size
        if size > MAX_BYTES[name]:
            raise ReportError(f"it has {size} bytes; at most {MAX_BYTES[name]} are read")
        return read_part(path)
    except (Error, OSError, ValueError, TypeError, KeyError, RecursionError, yaml.YAMLError) as error:
        notes.append(f"{name} was not read to its end: {_short(error)}")
        return None


def _outcome(folder: Path, result: RunResult | None, history: RunHistory) -> str:
    """Return the outcome; a run without an end was interrupted, unless its executor still answers."""
    if result is not None:
        return str(result.outcome)
    if history.end is not None:
        return str(history.end["outcome"])
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(1.0)
        try:
            connection.connect(str((folder / "control.sock").resolve()))
        except OSError:
            return INTERRUPTED
    return STILL_RUNNING


def _settings(about: dict[str, Any]) -> dict[str, str]:
    """Return the settings that may decide a run, except those that a report states elsewhere."""
    below = {"scene.": "scene_settings", "robot.": "robot_settings", "": "task"}
    found = {
        key: value
        for prefix, part in below.items()
        if isinstance(about.get(part), dict)
        for key, value in _flat(about[part], prefix)
    }
    if isinstance(about.get("driver"), str):
        found["driver"] = about["driver"]
    return {key: value for key, value in found.items() if key not in ("robot", "description")}


def _flat(values: dict[Any, Any], prefix: str) -> Iterator[tuple[str, str]]:
    for key, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def _read_about(config: str) -> dict[str, Any]:
    about = yaml.load(config, Loader=_PlainLoader)  # noqa: S506 - a safe loader
    if not isinstance(about, dict):
        raise ReportError("it holds no configuration of a run")
    return about


class _PlainLoader(yaml.BaseLoader):
    """Untrusted YAML: every scalar is its literal text.

    An alias makes a small file a huge value, and a number of many digits takes long: the one is refused, the other is
    never computed.
    """

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("it has aliases")
        node: yaml.Node | None = super().compose_node(parent, index)
        return node


def _failures(folder: Path, result: RunResult | None, history: RunHistory, notes: list[str]) -> Iterator[ReportFailure]:
    """Yield the failures of the log, or without a log that of the result."""
    logged = [line for _, line in history.log if line.node and line.level in ("warning", "error")]
    if not logged and result is not None and result.failure is not None:
        failure = result.failure
        yield ReportFailure(result.sim_time_s, failure.named, failure.error_code, failure.why)
    counts = Counter(logged)  # a leaf that is tried again at once may fail alike within one tick
    if len(counts) > MAX_FAILURES:
        notes.append(f"of {len(counts)} failures the last {MAX_FAILURES} are shown")
    taken = 0
    for event in list(counts)[-MAX_FAILURES:]:
        picture, seen = None, _seen(history, event)
        if seen is not None and taken < MAX_PICTURES:
            taken += 1
            picture = _picture(folder, seen.file, f"{seen.camera} at {seen.time:.2f} s", notes)
        yield ReportFailure(event.time, event.where or event.node, event.code, event.message, counts[event], picture)


def _seen(history: RunHistory, failure: LogEvent) -> Picture | None:
    """Return the picture that is of a failure: of its node, the nearest in time, of equals the later one."""
    taken = [one for one in history.pictures if one.file and one.node == failure.node]
    taken = [one for one in taken if abs(one.time - failure.time) <= SAME_MOMENT]
    return min(reversed(taken), key=lambda one: abs(one.time - failure.time), default=None)


def _pictures(folder: Path, notes: list[str]) -> Iterator[ReportPicture]:
    for name in NAMED_PICTURES:
        if (folder / f"{name}.png").is_file():
            picture = _picture(folder, f"{name}.png", name, notes)
            if picture is not None:
                yield picture


def _stops(folder: Path, notes: list[str]) -> Iterator[StopChart]:
    """Yield the charts of the black boxes, the first stop first."""
    for path in sorted(folder.glob(PATTERN), key=lambda one: (len(one.name), one.name))[:MAX_STOPS]:
        try:
            yield stop_chart(path.name, BlackBox.load(path))
        except BlackBoxError as error:
            notes.append(f"black box left out: {_short(error)}")


def _picture(folder: Path, name: str, caption: str, notes: list[str]) -> ReportPicture | None:
    """Return a picture of a run folder; it is decoded and encoded again, so that no other content of the file is
    published.
    """
    path = folder / name
    try:
        if not path.resolve(strict=True).is_relative_to(folder.resolve()):
            raise ValueError("it leads out of the run folder")
        if not path.is_file() or path.stat().st_size > MAX_FILE:
            raise ValueError(f"it is not a picture of at most {MAX_FILE} bytes")
        with Image.open(path, formats=("PNG", "JPEG")) as image:
            if image.width * image.height > MAX_PIXELS:
                raise ValueError(f"it has {image.width} × {image.height} pixels; at most {MAX_PIXELS} are read")
            small = image.convert("RGB")
            small.thumbnail((WIDTH, WIDTH))
    except (OSError, ValueError, SyntaxError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        notes.append(f"picture left out: {name!r}: {_short(error)}")
        return None
    out = io.BytesIO()
    small.save(out, "JPEG", quality=QUALITY, optimize=True)
    return ReportPicture(caption, out.getvalue(), small.width, small.height)


def _text(value: Any) -> str:
    return value[:LONGEST_TEXT] if isinstance(value, str) else ""


def _number(value: Any) -> int:
    text = _text(value)
    return int(text) if text.isascii() and text.isdigit() else 0


def _short(error: Exception) -> str:
    words = str(error).splitlines()
    return (words[0] if words else type(error).__name__)[:300]


INTERRUPTED = "interrupted"
STILL_RUNNING = "running"
LONGEST_SETTING = 200


@dataclass(frozen=True)
class ReportPicture:
    """``jpeg``: small enough for a page; ``caption``: its description."""

    caption: str
    jpeg: bytes
    width: int
    height: int


@dataclass(frozen=True)
class ReportFailure:
    """The failure of a leaf: time (seconds since the start), node, reason, repetitions, and a picture.

    ``node``: its name with file and line, or its path without a file.
    """

    time: float
    node: str
    code: str
    why: str
    count: int = 1
    picture: ReportPicture | None = None


@dataclass(frozen=True, eq=False)
class RunReport:
    """One run.

    ``outcome``: as in ``result.json``, or INTERRUPTED or STILL_RUNNING without one. ``started``: seconds since the
    epoch, None if unknown. ``duration``: seconds of the robot's clock up to the last known event. ``entry``: of a
    suite, or empty. ``settings``: further settings as for ``--set`` → text. ``result``: None if the run did not finish.
    ``stops``: black boxes. ``notes``: parts that could not be read, as text. ``source``: the external process that was
    watched.
    """

    folder: Path
    task: str
    seed: int
    robot: str
    scene: str
    entry: str
    settings: Mapping[str, str]
    outcome: str
    started: float | None
    duration: float
    result: RunResult | None
    config: str
    nodes: NodeList
    activities: Activities
    failures: tuple[ReportFailure, ...] = ()
    pictures: tuple[ReportPicture, ...] = ()
    stops: tuple[StopChart, ...] = ()
    notes: tuple[str, ...] = field(default=())
    source: str = ""

    @property
    def title(self) -> str:
        """The task, with seed or source."""
        which = self.source if self.source or (self.result is None and not self.config) else f"seed {self.seed}"
        return ", ".join(part for part in (self.task, which) if part)

    @property
    def scene_and_robot_settings(self) -> str:
        """The explicit settings of scene and robot as text."""
        return setting_words(self.settings, [key for key in self.settings if key.startswith(("scene.", "robot."))])

    @property
    def is_counted(self) -> bool:
        """Return whether the run completed, so that it counts in the success rate."""
        return self.result is not None and self.outcome != "cancelled"


def setting_words(settings: Mapping[str, str], keys: Iterable[str]) -> str:
    """Return ``key=value, …`` for the settings among ``keys``, each shortened."""
    return ", ".join(f"{key}={settings[key]}"[:LONGEST_SETTING] for key in keys if key in settings)
