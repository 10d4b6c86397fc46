"""Reads a run folder, whatever state it was left in, into the story of the run."""

from __future__ import annotations

import json
import math
import socket
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import TypeAdapter, ValidationError

from bestman_bt.engine.logs import logged_nodes, read_btlog
from bestman_bt.errors import Error, InputError
from bestman_bt.evaluation.report.activities import activities, ended_by
from bestman_bt.evaluation.report.embedded_picture import PictureError, embedded_picture
from bestman_bt.evaluation.report.plain_yaml import read_plain_yaml
from bestman_bt.evaluation.report.story import (
    INTERRUPTED,
    STILL_RUNNING,
    NodeKey,
    RunStory,
    StoryFailure,
    StoryNode,
    StoryPicture,
)
from bestman_bt.evaluation.result import DERIVED, RunResult
from bestman_bt.records.events import EndEvent, Event, ImageEvent, LogEvent, RunEvent, StatesEvent, TreeEvent
from bestman_bt.records.run_log import EVENTS_FILE, LOG_FILE, STATES_FILE, read_events, read_log

RESULT, CONFIG = "result.json", "config.yaml"
PARTS = (RESULT, CONFIG, STATES_FILE, EVENTS_FILE, LOG_FILE)
MAX_BYTES = {RESULT: 4_000_000, CONFIG: 256_000, STATES_FILE: 32_000_000}
"""Of what is read at once; events and log are read in bounded segments."""
LONGEST_TEXT = 200
MAX_FAILURES = 200
MAX_PICTURES = 50
NAMED_PICTURES = ("start", "grasp", "end")
SAME_MOMENT = 0.5
"""Seconds between a failure and the picture that is of it."""

_RESULT = TypeAdapter(RunResult)


class ReportError(InputError):
    """A folder is no run folder, or one whose report cannot be made."""


@dataclass
class _Parts:
    """What was found so far."""

    result: RunResult | None = None
    config: str = ""
    about: dict[str, Any] = field(default_factory=dict)
    settings: dict[str, str] = field(default_factory=dict)
    nodes: dict[NodeKey, StoryNode] = field(default_factory=dict)
    changes: list[tuple[float, NodeKey, int]] = field(default_factory=list)
    logged: list[LogEvent] = field(default_factory=list)
    images: list[ImageEvent] = field(default_factory=list)
    end: EndEvent | None = None
    started: float | None = None
    last: float = 0.0
    notes: list[str] = field(default_factory=list)


def run_folders(given: Path, depth: int = 4) -> list[Path]:
    """The run folders that a path means: itself, or all below it; ReportError where there is none."""
    if not given.is_dir():
        raise ReportError(f"{given} is no folder")
    found = list(_below(given, depth))
    if not found:
        raise ReportError(f"{given} is no run folder and holds none: none has {' or '.join(PARTS)}")
    return found


def _below(folder: Path, depth: int) -> Iterator[Path]:
    if any((folder / part).is_file() for part in PARTS):
        yield folder
    elif depth:
        for inner in sorted(folder.iterdir()):
            if inner.is_dir() and not inner.is_symlink():
                yield from _below(inner, depth - 1)


def read_story(folder: Path) -> RunStory:
    """The story that the files in ``folder`` tell; what is damaged is left out and noted.

    Raises ReportError where nothing can be read at all.
    """
    parts = _Parts()
    readers = (_read_result, _read_config, _read_states, _read_events, _read_log)
    read = 0
    for name, reader in zip(PARTS, readers, strict=True):
        path = folder / name
        if not path.is_file():
            continue
        try:
            size = path.stat().st_size
            if size > MAX_BYTES.get(name, size):
                raise ReportError(f"it has {size} bytes; at most {MAX_BYTES[name]} are read")
            reader(path, parts)
            read += 1
        except (Error, OSError, ValueError, TypeError, KeyError, RecursionError, yaml.YAMLError) as error:
            parts.notes.append(f"{name} was not read to its end: {_short(error)}")
    if not read:
        raise ReportError(f"{folder}: {'; '.join(parts.notes) or 'nothing of a run is in it'}")
    return _story(folder, parts)


def _story(folder: Path, parts: _Parts) -> RunStory:
    task = parts.about.get("task") if isinstance(parts.about.get("task"), dict) else {}
    result = parts.result
    duration = result.sim_time_s if result is not None else parts.last
    if parts.end is not None:
        duration = max(duration, parts.end.time)
    changes = sorted((c for c in parts.changes if c[1] in parts.nodes), key=lambda change: change[0])
    return RunStory(
        folder=folder,
        task=result.task if result is not None else _text(parts.about.get("name")) or folder.name,
        seed=result.seed if result is not None else _number(parts.about.get("seed")),
        robot=_text(task.get("robot") if task else ""),
        scene=_text(task.get("scene") if task else ""),
        entry=_text(parts.about.get("entry")),
        settings=parts.settings,
        outcome=_outcome(folder, parts),
        started=parts.started,
        duration=duration,
        result=result,
        config=parts.config,
        nodes=tuple(_in_reading_order(parts.nodes)),
        activities=tuple(activities(changes, parts.last)),
        ended_by=_ended_by(parts, changes),
        failures=tuple(_failures(folder, parts)),
        pictures=tuple(_pictures(folder, parts)),
        notes=tuple(parts.notes),
    )


def _ended_by(parts: _Parts, changes: list[tuple[float, NodeKey, int]]) -> tuple[NodeKey, float] | None:
    """Of the main tree, which stands in ``transitions.btlog``."""
    main = [node for key, node in parts.nodes.items() if key[0] == 0]
    leaves = {node.key for node in main if node.is_leaf}
    return ended_by(changes, main[0].key, leaves) if main else None


def _outcome(folder: Path, parts: _Parts) -> str:
    """A run without an end was interrupted, unless its executor still answers."""
    if parts.result is not None:
        return str(parts.result.outcome)
    if parts.end is not None:
        return parts.end.outcome
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(1.0)
        try:
            connection.connect(str((folder / "control.sock").resolve()))
        except OSError:
            return INTERRUPTED
    return STILL_RUNNING


def _settings(about: dict[str, Any]) -> dict[str, str]:
    """Everything of a run's configuration that may decide it, but what a report names otherwise."""
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


def _read_result(path: Path, parts: _Parts) -> None:
    document = json.loads(path.read_bytes())
    if not isinstance(document, dict):
        raise ReportError("it is no JSON object")
    document = {key: value for key, value in document.items() if key not in DERIVED}
    metrics = document.get("metrics")
    if isinstance(metrics, dict):
        document["metrics"] = {key: math.nan if value is None else value for key, value in metrics.items()}
    try:
        parts.result = _RESULT.validate_python(document)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ReportError(f"{where}: {first['msg']}") from error


def _read_config(path: Path, parts: _Parts) -> None:
    parts.config = path.read_text(encoding="utf-8")
    about = read_plain_yaml(parts.config)
    if not isinstance(about, dict):
        raise ReportError("it holds no configuration of a run")
    parts.about, parts.settings = about, _settings(about)


def _read_states(path: Path, parts: _Parts) -> None:
    log = read_btlog(path)
    for node in logged_nodes(log.xml, STATES_FILE):
        _add_node(parts, (0, node.uid), None if node.parent is None else (0, node.parent), node)
    parts.started = log.start
    parts.changes += [(t.time, (0, t.uid), t.status) for t in log]
    parts.last = max([parts.last, *(t.time for t in log.transitions[-1:])])


def _read_events(path: Path, parts: _Parts) -> None:
    for event in read_events(path.parent):
        _take_event(event, parts)


def _read_log(path: Path, parts: _Parts) -> None:
    for line in read_log(path.parent):
        _take_event(line, parts)


def _take_event(event: Event, parts: _Parts) -> None:
    time = getattr(event, "time", 0.0)
    if not math.isfinite(time):
        raise ReportError(f"an event is of the time {time}")
    parts.last = max(parts.last, time)
    match event:
        case RunEvent():
            parts.started = event.started
        case TreeEvent(tree=0):  # the nodes are in the log of states, which does not tell their files
            for node in event.nodes:
                known = parts.nodes.get((0, node.uid))
                if known is not None and known.path == node.path:
                    parts.nodes[known.key] = replace(known, where=node.where)
        case TreeEvent():
            under = None if event.under is None else (0, event.under)
            for node in event.nodes:
                parent = under if node.parent is None else (event.tree, node.parent)
                _add_node(parts, (event.tree, node.uid), parent, node)
        case StatesEvent() if event.tree:
            parts.changes += [(event.time, (event.tree, uid), state) for uid, state in event.changes]
        case LogEvent() if event.node and event.level in ("warning", "error"):
            parts.logged.append(event)
        case ImageEvent() if event.file:
            parts.images.append(event)
        case EndEvent():
            parts.end = event


def _add_node(parts: _Parts, key: NodeKey, parent: NodeKey | None, node: Any) -> None:
    if key not in parts.nodes:
        above = parts.nodes.get(parent) if parent is not None else None
        depth = 0 if above is None else above.depth + (above.category == "subtree" or above.is_leaf)
        where = getattr(node, "where", "")
        parts.nodes[key] = StoryNode(key, parent, node.name, node.type, node.category, node.path, depth, where)


def _in_reading_order(nodes: dict[NodeKey, StoryNode]) -> Iterator[StoryNode]:
    """A parent, then what is below it: trees that a leaf ticked stand below that leaf."""
    below: dict[NodeKey | None, list[StoryNode]] = {}
    for node in nodes.values():
        below.setdefault(node.parent if node.parent in nodes else None, []).append(node)
    pending = below.get(None, [])[::-1]
    while pending:
        node = pending.pop()
        yield node
        pending += below.get(node.key, [])[::-1]


def _failures(folder: Path, parts: _Parts) -> Iterator[StoryFailure]:
    """Of the log; without one, the failure that the result tells."""
    if not parts.logged and parts.result is not None and parts.result.failure is not None:
        failure = parts.result.failure
        yield StoryFailure(parts.result.sim_time_s, failure.named, failure.error_code, failure.why)
    counts = Counter(parts.logged)  # a leaf that is tried again at once may fail alike within one tick
    if len(counts) > MAX_FAILURES:
        parts.notes.append(f"of {len(counts)} failures the last {MAX_FAILURES} are shown")
    taken = 0
    for event in list(counts)[-MAX_FAILURES:]:
        picture = None
        seen = [i for i in parts.images if i.node == event.node and abs(i.time - event.time) <= SAME_MOMENT]
        if seen and taken < MAX_PICTURES:
            taken += 1
            nearest = min(reversed(seen), key=lambda image: abs(image.time - event.time))
            picture = _picture(folder, nearest.file, f"{nearest.camera} at {nearest.time:.2f} s", parts)
        yield StoryFailure(event.time, event.where or event.node, event.code, event.message, counts[event], picture)


def _pictures(folder: Path, parts: _Parts) -> Iterator[StoryPicture]:
    for name in NAMED_PICTURES:
        if (folder / f"{name}.png").is_file():
            picture = _picture(folder, f"{name}.png", name, parts)
            if picture is not None:
                yield picture


def _picture(folder: Path, name: str, caption: str, parts: _Parts) -> StoryPicture | None:
    try:
        return embedded_picture(folder, name, caption)
    except PictureError as error:
        parts.notes.append(f"picture left out: {_short(error)}")
        return None


def _text(value: Any) -> str:
    return value[:LONGEST_TEXT] if isinstance(value, str) else ""


def _number(value: Any) -> int:
    text = _text(value)
    return int(text) if text.isascii() and text.isdigit() else 0


def _short(error: Exception) -> str:
    words = str(error).splitlines()
    return (words[0] if words else type(error).__name__)[:300]
