"""Sends events from the executor to files and subscribers; a separate thread builds them."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from bestman_bt.engine import IDLE
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.events import (
    MAIN_TREE,
    BlackboardEvent,
    BreakpointsEvent,
    DroppedEvent,
    EndEvent,
    Event,
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
    Topic,
    TreeEvent,
    to_line,
    topic_of,
)
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.records.writer import RunLogWriter


@dataclass
class _TreeStanding:
    event: TreeEvent
    states: dict[int, int]
    messages: dict[int, str] = field(default_factory=dict)


class StateSnapshot:
    """The current state of an execution: ``take`` updates it, ``events`` returns events that reproduce it."""

    def __init__(self) -> None:
        self._run: RunEvent | None = None
        self._trees: dict[int, _TreeStanding] = {}
        self._latest: dict[str, Event] = {}
        self._blackboard: dict[str, dict[str, ShownEntry]] = {}
        self.time = 0.0
        """Time of the latest event, seconds."""
        self.tick = 0

    @property
    def states(self) -> Mapping[int, int]:
        """The state of each node of the main tree, by uid."""
        return self._trees[MAIN_TREE].states

    @property
    def paused(self) -> PausedEvent | None:
        """Why the execution is paused; None if it is not."""
        paused = self._latest.get("paused")
        return paused if isinstance(paused, PausedEvent) else None

    @property
    def breakpoints(self) -> list[dict[str, Any]]:
        """The current breakpoints."""
        points = self._latest.get("breakpoints")
        return points.breakpoints if isinstance(points, BreakpointsEvent) else []

    def _take_tree(self, event: TreeEvent) -> None:
        ended = [number for number, tree in self._trees.items() if number and tree.event.under == event.under]
        for number in ended:
            del self._trees[number]
        self._trees[event.tree] = _TreeStanding(event, {node.uid: IDLE for node in event.nodes})

    def take(self, event: Event) -> None:
        """Store the content of an event."""
        match event:
            case RunEvent():
                self._run = event
            case TreeEvent():
                self._take_tree(event)
            case StatesEvent():
                self.time, self.tick = event.time, event.tick
                if event.tree in self._trees:
                    self._trees[event.tree].states.update(event.changes)
                    self._trees[event.tree].messages.update(event.messages)
            case BlackboardEvent():
                self.time, self.tick = event.time, event.tick
                for scope, entries in event.entries.items():
                    self._blackboard.setdefault(scope, {}).update(entries)
            case ResumedEvent():
                self._latest.pop("paused", None)
            case MapEvent() | RobotEvent() | ScanEvent() | PathEvent():
                self._latest[event.event] = event
            case PausedEvent() | BreakpointsEvent() | EndEvent():
                self._latest[event.event] = event

    def events(self, topics: Collection[Topic]) -> Iterator[Event]:
        """Yield the run, the trees and the current state of these topics; nothing before the first event."""
        if self._run is None:
            return
        yield self._run
        for tree in self._trees.values():
            yield tree.event
        if "map" in self._latest:
            yield self._latest["map"]
        if "states" in topics:
            for number, tree in self._trees.items():
                yield StatesEvent(self.time, self.tick, list(tree.states.items()), dict(tree.messages), number)
        if "blackboard" in topics:
            entries = {scope: dict(entries) for scope, entries in self._blackboard.items()}
            yield BlackboardEvent(self.time, self.tick, entries)
        for name, event in list(self._latest.items()):
            if name != "map" and topic_of(event) in (None, *topics):
                yield event


MAX_WAITING = 20_000
"""Largest number of queued items, such as ticks; further ones, for example on a hanging disk, are dropped."""
FLUSH_EVERY = 0.25
"""Largest time until written data are flushed to the files, seconds."""
REST = 0.005
"""Seconds between checks of the queue, so that ticks in quick succession do not each wake the thread."""
LOGS = "the run's logs"
LAST_EVENTS = 10.0
"""Seconds for the thread to write the remaining items at the end."""

Making = Callable[[], Iterable[Event]]
"""Creates events, in the thread of the stream."""
Publish = Callable[[Making], bool]
"""Queues events for creation and publication; returns False if they are lost."""


@dataclass(eq=False)
class _Subscription:
    outbox: SubscriberQueue
    topics: frozenset[Topic]
    missed: int = 0


class EventStream:
    """The events of an execution. ``publish`` only puts an item into a queue; a separate thread does the rest."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[Making | None] = queue.SimpleQueue()
        self._subscriptions: list[_Subscription] = []
        self._standing = StateSnapshot()
        self._log: RunLogWriter | None = None
        self._keeping = RecordingErrors()
        self._lost = 0
        self._flushed = 0.0
        self._thread = threading.Thread(target=self._run, name="events", daemon=True)
        self.wanted: frozenset[Topic] = frozenset()
        """The topics that have subscribers."""

    def start(self, log: RunLogWriter | None, keeping: RecordingErrors | None = None) -> None:
        """Start the thread.

        ``log`` receives every event; it is closed at the end or at the first failed write, which is reported to
        ``keeping``.
        """
        self._log, self._keeping = log, keeping or RecordingErrors()
        self._thread.start()

    def publish(self, make: Making) -> bool:
        """Queue an event for publication, in order. Returns False if the queue is full."""
        if self._waiting.qsize() >= MAX_WAITING:
            self._lost += 1
            return False
        self._waiting.put(make)
        return True

    @property
    def waiting(self) -> int:
        """Return the number of queued events that are not published yet."""
        return self._waiting.qsize()

    def add(self, outbox: SubscriberQueue, topics: frozenset[Topic]) -> None:
        """Send the current state of ``topics`` to ``outbox``, then every event of them; replaces an earlier
        subscription.
        """
        self.publish(lambda: self._add(_Subscription(outbox, topics)))

    def forget(self, outbox: SubscriberQueue) -> None:
        """Send no more events to ``outbox``."""
        self.publish(lambda: self._forget(outbox))

    def begin_anew(self) -> None:
        """Discard the current state: without subscribers, no state is kept."""
        self.publish(self._forget_standing)

    def close(self) -> None:
        """Publish the queued events, close the files and end all subscriptions."""
        self._waiting.put(None)
        self._thread.join(LAST_EVENTS)
        for subscription in self._subscriptions:
            subscription.outbox.close()

    def _run(self) -> None:
        try:
            while self._work_off():
                time.sleep(REST)
        finally:
            if self._log is not None:
                self._write(self._log.close)

    def _work_off(self) -> bool:
        """Process all queued items, or wait for one; return False at the end."""
        with contextlib.suppress(queue.Empty):
            make = self._waiting.get(timeout=None if self._log is None else FLUSH_EVERY)
            while make is not None:
                self._make(make)
                self._flush_when_due()
                make = self._waiting.get_nowait()
            return False
        self._flush_when_due()
        return True

    def _make(self, make: Making) -> None:
        try:
            for event in make():
                self._hand_on(event)
        except Exception as error:  # noqa: BLE001 - of values of users' types, or a picture's file: the rest is told
            message = f"an event could not be made: {type(error).__name__}: {error}"
            self._hand_on(LogEvent(self._standing.time, "error", message, logger=__name__))

    def _flush_when_due(self) -> None:
        if self._lost:
            lost, self._lost = self._lost, 0
            self._hand_on(DroppedEvent(lost))
        now = time.monotonic()
        if self._log is not None and now - self._flushed >= FLUSH_EVERY:
            self._flushed = now
            self._write(self._log.flush)

    def _hand_on(self, event: Event) -> None:
        self._standing.take(event)
        self._keep(event)
        topic, line = topic_of(event), b""
        for subscription in self._subscriptions:
            if topic is None or topic in subscription.topics:
                line = line or to_line(event)
                self._send(subscription, line)

    def _keep(self, event: Event) -> None:
        log = self._log
        if log is not None:
            self._write(lambda: log.write(event))

    def _write(self, write: Callable[[], None]) -> None:
        """Write to the log; if that fails, notify the subscribers and write nothing more."""
        log = self._log
        if self._keeping.write(LOGS, write) or log is None:
            return
        self._log = None
        with contextlib.suppress(OSError):
            log.close()
        message = f"nothing is kept of the run from here on: {self._keeping.lost[LOGS]}"
        self._hand_on(LogEvent(self._standing.time, "error", message, logger=__name__))

    def _send(self, subscription: _Subscription, line: bytes) -> None:
        outbox = subscription.outbox
        if not subscription.missed:
            subscription.missed += not outbox.send(line)
            return
        if not outbox.has_room:
            subscription.missed += 1
            return
        outbox.send(to_line(DroppedEvent(subscription.missed)))
        subscription.missed = 0
        self._publish_all(subscription)

    def _publish_all(self, subscription: _Subscription) -> None:
        for event in self._standing.events(subscription.topics):
            subscription.missed += not subscription.outbox.send(to_line(event))

    def _add(self, subscription: _Subscription) -> Iterable[Event]:
        self._forget(subscription.outbox)
        self._subscriptions.append(subscription)
        self._note_wanted()
        self._publish_all(subscription)
        return ()

    def _forget(self, outbox: SubscriberQueue) -> Iterable[Event]:
        self._subscriptions = [other for other in self._subscriptions if other.outbox is not outbox]
        self._note_wanted()
        return ()

    def _forget_standing(self) -> Iterable[Event]:
        self._standing = StateSnapshot()
        return ()

    def _note_wanted(self) -> None:
        self.wanted = frozenset(topic for subscription in self._subscriptions for topic in subscription.topics)
