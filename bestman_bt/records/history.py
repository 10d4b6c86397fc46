"""The history of one run and its robot, at any time: built from its events, queried by viewers."""

from __future__ import annotations

import base64
import binascii
from array import array
from bisect import bisect_right
from collections import deque
from collections.abc import Hashable, Iterator
from dataclasses import asdict, dataclass
from itertools import chain, islice, takewhile
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from bestman_bt.engine.logs.btlog import Transitions
from bestman_bt.engine.status import FAILURE, SKIPPED
from bestman_bt.records.events import (
    MAIN_TREE,
    BlackboardEvent,
    BreakpointsEvent,
    DroppedEvent,
    EndEvent,
    Event,
    EventError,
    ImageEvent,
    LogEvent,
    MapEvent,
    PathEvent,
    PausedEvent,
    ResumedEvent,
    RobotEvent,
    RunEvent,
    ScanEvent,
    ShownEntry,
    StatesEvent,
    TreeEvent,
)
from bestman_bt.records.nodes import NodeList
from bestman_bt.records.states import NO, StateHistory
from bestman_bt.records.timeline import Timeline

MAX_LOG_LINES = 20_000
MAX_MESSAGES_A_NODE = 500
MAX_VALUES_A_KEY = 1_000
MAX_KEYS = 5_000
MAX_PATHS = 500
MAX_PICTURES = 300
"""Largest number of stored pictures per camera; the oldest are dropped first."""
MAX_TEXT = 4096
"""Largest number of characters of a text sent to the page."""

PIECE = 1 << 17
"""Number of state changes processed at a time, which bounds the memory for temporary data."""
LONGEST_RUN = 1e9
"""Seconds."""


@dataclass(frozen=True)
class Picture:
    """A picture that a camera took: bytes in memory, or the name of a file in the run folder."""

    number: int
    camera: str
    time: float
    node: str
    jpeg: bytes
    file: str


class RunHistory:
    """Call ``take`` with the events of a run in order; ``version`` counts them, so that viewers can query changes.

    ``xml``: of the main tree. ``faults``: unreadable parts of the run folder, as text.
    """

    def __init__(self) -> None:
        self.version = 0
        self.about: dict[str, Any] = {}
        self.nodes = NodeList()
        self.states = StateHistory()
        self.timeline = Timeline()
        self.xml = ""
        self.faults: list[str] = []
        self.robot = RobotHistory()
        self.map: dict[str, Any] | None = None
        self.paths: Samples[list[tuple[float, float]]] = Samples(MAX_PATHS)
        self.log: deque[tuple[int, LogEvent]] = deque(maxlen=MAX_LOG_LINES)
        self.pictures: deque[Picture] = deque(maxlen=MAX_PICTURES)
        self.paused: dict[str, Any] | None = None
        self.breakpoints: list[dict[str, Any]] = []
        self.end: dict[str, Any] | None = None
        self.dropped = 0
        self.tree_version = self.paused_version = self.breakpoints_version = self.path_version = 0
        self.changed_messages: Freshness[int] = Freshness()
        self.changed_entries: Freshness[tuple[str, str]] = Freshness()
        self._main = (0, 0)
        self._node_versions = np.full(1, -1)
        self._is_leaf = self._is_condition = np.zeros(1, bool)
        self._messages: dict[int, Samples[str]] = {}
        self._entries: dict[tuple[str, str], Samples[ShownEntry | None]] = {}
        self._time = 0.0
        self.tick = 0  # the newest that any event tells of: while leaves run, no state changes
        self._picture_number = 0

    @property
    def last(self) -> float:
        """The newest time, in seconds since the run's start."""
        return max(self._time, self.states.time)

    def message_at(self, uid: int, time: float) -> str:
        """Return the last feedback of a node at ``time`` or before; may be empty."""
        found = self._messages[uid].at(time) if uid in self._messages else None
        return found[1] if found is not None else ""

    def messages_at(self, time: float) -> dict[str, str]:
        """Return uid → feedback of all nodes that have any."""
        return {str(uid): text for uid in self._messages if (text := self.message_at(uid, time))}

    def entry_at(self, scope: str, key: str, time: float) -> dict[str, Any] | None:
        """Return a blackboard entry with ``changed_at``, or None if there is none at ``time``."""
        found = self._entries[scope, key].at(time)
        return None if found is None or found[1] is None else {**asdict(found[1]), "changed_at": found[0]}

    def blackboard_at(self, time: float) -> dict[str, dict[str, dict[str, Any]]]:
        """Return the blackboard at ``time``: scope → key → entry."""
        boards: dict[str, dict[str, dict[str, Any]]] = {}
        for scope, key in self._entries:
            entry = self.entry_at(scope, key, time)
            if entry is not None:
                boards.setdefault(scope, {})[key] = entry
        return boards

    def changed_nodes(self, version: int) -> NDArray[np.intp]:
        """Return the uids of the nodes that changed after ``version``, in the order of the tree."""
        return np.flatnonzero(self._node_versions > version)

    def pictures_at(self, time: float) -> list[Picture]:
        """Return the latest picture of each camera."""
        latest = {picture.camera: picture for picture in self.pictures if picture.time <= time}
        return list(latest.values())

    def picture(self, number: int) -> Picture | None:
        """Return a picture that is still held."""
        return next((picture for picture in self.pictures if picture.number == number), None)

    def lines_since(self, version: int, most: int) -> list[dict[str, Any]]:
        """Return the newest ``most`` log lines after ``version``."""
        fresh = takewhile(lambda pair: pair[0] > version, reversed(self.log))
        return [asdict(line) for _, line in islice(fresh, most)][::-1]

    def take(self, event: Event) -> None:
        """Add an event. Raises EventError if it contradicts earlier events; the history then stays unchanged."""
        self.version += 1
        self._take_time(event)
        self.tick = max(self.tick, getattr(event, "tick", 0))
        match event:
            case RunEvent() | EndEvent() | DroppedEvent():
                self._take_run(event)
            case TreeEvent():
                self._take_tree(event)
            case StatesEvent():
                self._take_states(event)
            case BlackboardEvent():
                self._take_blackboard(event)
            case RobotEvent() | ScanEvent() | MapEvent() | PathEvent():
                self._take_robot(event)
            case ImageEvent():
                self._take_image(event)
            case LogEvent():
                self._take_log(event)
            case PausedEvent() | ResumedEvent():
                self._take_pause(event)
            case BreakpointsEvent():
                self.breakpoints, self.breakpoints_version = event.breakpoints, self.version

    def _take_time(self, event: Event) -> None:
        time = getattr(event, "time", None)
        if time is not None:
            if not abs(time) < LONGEST_RUN:
                raise EventError(f"{event.event}: {time} is not a time")
            self._time = max(self._time, time)

    def _take_run(self, event: RunEvent | EndEvent | DroppedEvent) -> None:
        match event:
            case RunEvent():
                self.about = asdict(event)
            case EndEvent():
                self.end = asdict(event)
                self.paused, self.paused_version = None, self.version
                self.timeline.mark(event.time, "end", event.outcome)
            case DroppedEvent():
                self.dropped += event.count

    def _take_robot(self, event: RobotEvent | ScanEvent | MapEvent | PathEvent) -> None:
        match event:
            case RobotEvent():
                self.robot.take(event, self.version)
            case ScanEvent():
                self.robot.add_scan(event, self.version)
            case MapEvent():
                self.map = asdict(event)
                self.tree_version = self.version
            case PathEvent():
                self.paths.add(event.time, event.planned)
                self.path_version = self.version

    def _take_tree(self, event: TreeEvent) -> None:
        for node in self.nodes.add(event):
            if node.is_leaf or node.category == "subtree":
                self.timeline.add_node(node.uid)
        if event.tree == MAIN_TREE:
            self.xml, self._main = event.xml, self.nodes.range_of(MAIN_TREE)
        self._is_leaf = np.array([False, *(node.is_leaf for node in self.nodes)])
        self._is_condition = np.array([False, *(node.category == "condition" for node in self.nodes)])
        self.states.now = self.states.now.grown(len(self.nodes))
        added = len(self.nodes) + 1 - len(self._node_versions)
        self._node_versions = np.append(self._node_versions, np.full(added, -1))
        self.tree_version = self.version

    def shown(self, event: StatesEvent) -> Transitions:
        """Return the changes of an event by uids of ``nodes``, with NO for false conditions."""
        offset, count = self.nodes.range_of(event.tree)
        told = np.fromiter(chain.from_iterable(event.changes), np.int64, 2 * len(event.changes)).reshape(-1, 2)
        uids, states = told[(told > [0, -1]).all(axis=1) & (told <= [count, SKIPPED]).all(axis=1)].T
        moment = np.full(len(uids), event.time)
        return self.with_answers(Transitions(moment, (offset + uids).astype(np.uint32), states.astype(np.uint8)))

    def _take_states(self, event: StatesEvent) -> None:
        changes = self.shown(event)
        if len(changes):
            self.add_changes(changes, np.full(len(changes), event.tick))
        elif not event.messages:  # a step that changed nothing
            self.states.record(event.time, event.tick)
        offset, count = self.nodes.range_of(event.tree)
        for uid, text in event.messages.items():
            if 0 < uid <= count:
                said = self._messages.setdefault(offset + uid, Samples(MAX_MESSAGES_A_NODE))
                said.add(event.time, text[:MAX_TEXT])
                self.changed_messages.touch(offset + uid, self.version)

    def add_changes(self, changes: Transitions, ticks: NDArray[np.int64]) -> None:
        """Add changes in their displayed form, in the order of time, with the tick of each."""
        for begin in range(0, len(changes), PIECE):
            fresh = self.states.extend(changes[begin : begin + PIECE], ticks[begin : begin + PIECE])
            self.timeline.change(fresh)
            self._node_versions[fresh.uids] = self.version

    def with_answers(self, changes: Transitions) -> Transitions:
        """Replace FAILURE by NO for false conditions; in the order of time, by uids of ``nodes``."""
        answers = self._are_answers(changes)
        return Transitions(changes.times, changes.uids, np.where(answers, NO, changes.statuses).astype(np.uint8))

    def _are_answers(self, changes: Transitions) -> NDArray[np.bool_]:
        """Return which changes are the answer "no": FAILURE of a condition, unless the main tree fails by it.

        The main tree fails by the last leaf that fails at the moment at which its root does.
        """
        failed = changes.statuses == FAILURE
        answers: NDArray[np.bool_] = failed & self._is_condition[changes.uids]
        if not answers.any():
            return answers
        offset, count = self._main
        inside = failed & (changes.uids > offset) & (changes.uids <= offset + count)
        for time in changes.times[inside & (changes.uids == offset + 1)]:
            moment = slice(*(int(np.searchsorted(changes.times, time, side)) for side in ("left", "right")))
            leaves = changes.uids[moment][inside[moment] & self._is_leaf[changes.uids[moment]]]
            answers[moment] &= changes.uids[moment] != (leaves[-1] if len(leaves) else 0)
        return answers

    def _take_blackboard(self, event: BlackboardEvent) -> None:
        for scope, entries in event.entries.items():
            for key, entry in entries.items():
                place = (scope, key)
                if place not in self._entries:
                    if len(self._entries) >= MAX_KEYS:
                        continue
                    self._entries[place] = Samples(MAX_VALUES_A_KEY)
                self._entries[place].add(event.time, entry if entry.type else None)
                self.changed_entries.touch(place, self.version)

    def _take_image(self, event: ImageEvent) -> None:
        self._picture_number += 1
        try:
            jpeg = base64.b64decode(event.jpeg, validate=True)
        except binascii.Error as error:
            raise EventError(f"image: {error}") from error
        self.pictures.append(Picture(self._picture_number, event.camera, event.time, event.node, jpeg, event.file))
        self.timeline.mark(event.time, "image", f"picture of {event.camera}")

    def _take_log(self, event: LogEvent) -> None:
        self.log.append((self.version, event))
        if event.level in ("warning", "error"):
            words = ": ".join(part for part in (event.node, event.code, event.message) if part)
            self.timeline.mark(event.time, event.level, words)

    def _take_pause(self, event: PausedEvent | ResumedEvent) -> None:
        self.paused_version = self.version
        if isinstance(event, ResumedEvent):
            self.paused = None
        else:
            self.paused = asdict(event)
            self.timeline.mark(event.time, "paused", event.reason)


T = TypeVar("T")
K = TypeVar("K", bound=Hashable)


class Samples(Generic[T]):
    """A buffer of at most ``limit`` timed values; beyond that, every second value of the older half is dropped."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._times: list[float] = []
        self._values: list[T] = []

    def __len__(self) -> int:
        return len(self._times)

    def __iter__(self) -> Iterator[tuple[float, T]]:
        return zip(self._times, self._values, strict=True)

    def add(self, time: float, value: T) -> None:
        """Add a value; decreasing times are replaced by the last one."""
        self._times.append(max(time, self._times[-1]) if self._times else time)
        self._values.append(value)
        if len(self._times) > self._limit:
            half = self._limit // 2
            del self._times[1:half:2], self._values[1:half:2]

    def at(self, time: float) -> tuple[float, T] | None:
        """Return the last value at ``time`` or before, with its own time."""
        index = bisect_right(self._times, time) - 1
        return (self._times[index], self._values[index]) if index >= 0 else None

    @property
    def last(self) -> tuple[float, T] | None:
        """The newest value, with its time."""
        return (self._times[-1], self._values[-1]) if self._times else None


class Freshness(Generic[K]):
    """Keys in the order of their last change, so that a query of recent changes is cheap."""

    def __init__(self) -> None:
        self._versions: dict[K, int] = {}

    def touch(self, key: K, version: int) -> None:
        """Record that ``key`` changed; versions never decrease."""
        self._versions.pop(key, None)
        self._versions[key] = version

    def since(self, version: int) -> list[K]:
        """Return the keys that changed after ``version``, the newest first."""
        changed = []
        for key, touched in reversed(self._versions.items()):
            if touched <= version:
                break
            changed.append(key)
        return changed


MAX_SAMPLES = 36_000
"""An hour at 10 per second; older samples are thinned out."""
MAX_SCANS = 1_800
MAX_POINTS = 2_000
"""Largest number of stored points per scan."""
SERIES_POINTS = 1_500
"""Points of one joint's curve."""
PLAIN = ("base", "believed_std", "held", "diagnostics", "speed")
JOINT_VALUES = ("joints", "velocities", "efforts")


@dataclass(frozen=True)
class _Sample:
    """``names`` is shared by all samples with the same joints."""

    plain: dict[str, Any]
    names: dict[str, tuple[str, ...]]
    values: dict[str, array[float]]

    def document(self) -> dict[str, Any]:
        joints = {
            field: dict(zip(self.names[field], (round(value, 5) for value in values), strict=True))
            for field, values in self.values.items()
        }
        return {**self.plain, **joints}


class RobotHistory:
    """Robot samples over time. ``version``, ``scan_version``: numbers of the newest sample and of the newest scan."""

    def __init__(self) -> None:
        self.version = 0
        self.scan_version = 0
        self._samples: Samples[_Sample] = Samples(MAX_SAMPLES)
        self._scans: Samples[tuple[tuple[float, float, float], array[float]]] = Samples(MAX_SCANS)
        self._names: dict[str, tuple[str, ...]] = {}

    def take(self, event: RobotEvent, version: int) -> None:
        """Add a sample."""
        values, names = {}, {}
        for field in JOINT_VALUES:
            told: dict[str, float] | None = getattr(event, field)
            if told:
                mine = tuple(told)
                if self._names.get(field) != mine:
                    self._names[field] = mine
                names[field] = self._names[field]
                values[field] = array("f", told.values())
        plain = {field: getattr(event, field) for field in PLAIN if getattr(event, field) is not None}
        self._samples.add(event.time, _Sample(plain, names, values))
        self.version = version

    def add_scan(self, event: ScanEvent, version: int) -> None:
        """Add a scan."""
        stride = -(-len(event.points) // MAX_POINTS) or 1
        self._scans.add(event.time, (event.base, array("f", chain.from_iterable(event.points[::stride]))))
        self.scan_version = version

    def at(self, time: float) -> dict[str, Any] | None:
        """Return the newest sample at ``time`` or before, in the page's format."""
        found = self._samples.at(time)
        return None if found is None else {"time": found[0], **found[1].document()}

    def scan_at(self, time: float) -> dict[str, Any] | None:
        """Return the newest scan at ``time`` or before."""
        found = self._scans.at(time)
        if found is None:
            return None
        base, flat = found[1]
        values = [round(value, 3) for value in flat]
        return {
            "time": found[0],
            "base": base,
            "points": [list(pair) for pair in zip(values[::2], values[1::2], strict=True)],
        }

    def joint_names(self) -> list[str]:
        """Return the joints of the newest sample."""
        return list(self._names.get("joints", ()))

    def series(self, joints: list[str]) -> dict[str, list[list[float]]]:
        """Return joint → [[time, position], …], seconds and radians or metres, at most ``SERIES_POINTS`` each."""
        stride = -(-len(self._samples) // SERIES_POINTS) or 1
        curves: dict[str, list[list[float]]] = {name: [] for name in joints}
        for index, (time, sample) in enumerate(self._samples):
            if index % stride and index != len(self._samples) - 1:
                continue
            positions = dict(zip(sample.names.get("joints", ()), sample.values.get("joints", ()), strict=True))
            for name, curve in curves.items():
                if name in positions:
                    curve.append([round(time, 3), round(positions[name], 5)])
        return curves

    def driven(self, time: float) -> list[list[float]]:
        """Return the driven path of the base up to ``time``: [[x, y], …] metres, at most ``SERIES_POINTS``."""
        upto = [list(sample.plain["base"][:2]) for stamp, sample in self._samples if stamp <= time]
        return upto[:: -(-len(upto) // SERIES_POINTS) or 1]
