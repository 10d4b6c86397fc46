"""Telemetry of one execution: events for its run folder and for subscribers.

The executor's thread only collects references; the thread of an ``EventStream`` turns them into events. Without a
folder and subscribers nothing is collected.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Protocol

from behaviours.failure import NodeFailure
from bestman_bt.engine import FAILURE, RUNNING, SUCCESS, Node, StateChanges, Tree
from bestman_bt.engine.blackboard import Slot
from bestman_bt.engine.status import state_code, uid_and_state
from bestman_bt.monitor.event_stream import LOGS, EventStream, Publish
from bestman_bt.monitor.subscriber_queue import SubscriberQueue
from bestman_bt.records.described_tree import describe_tree
from bestman_bt.records.events import (
    MAIN_TREE,
    BlackboardEvent,
    EndEvent,
    Event,
    Level,
    LogEvent,
    PausedEvent,
    ResumedEvent,
    RunEvent,
    ShownEntry,
    StatesEvent,
    Topic,
)
from bestman_bt.records.keeping import RecordingErrors
from bestman_bt.records.shown_value import REMOVED, show_value
from bestman_bt.records.writer import RunLogWriter
from bestman_bt.runtime.executor import Execution, Executor, PauseReason, TerminationReason
from bestman_bt.runtime.failure_lines import FailureLines, failure_codes

PACKAGES = ("bestman_bt", "behaviours", "hal")
_LEVELS: dict[int, Level] = {logging.ERROR: "error", logging.WARNING: "warning", logging.INFO: "info"}
"""Level number → level of events, highest first."""


class PackageLog(logging.Handler):
    """A context manager that turns log records from INFO on into events. ``now``: returns the time of events."""

    def __init__(self, publish: Callable[[LogEvent], None], now: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self._publish, self._now = publish, now
        self._stack, self._formatter = ExitStack(), logging.Formatter()

    def __enter__(self) -> PackageLog:
        for name in PACKAGES:
            logger = logging.getLogger(name)
            self._stack.callback(logger.setLevel, logger.level)
            logger.setLevel(min(logging.INFO, logger.getEffectiveLevel()))
            logger.addHandler(self)
            self._stack.callback(logger.removeHandler, self)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def emit(self, record: logging.LogRecord) -> None:
        """Publish a record."""
        try:
            message = record.getMessage()
            if record.exc_info and record.exc_info[1] is not None:
                trace = self._formatter.formatException(record.exc_info)
                message = f"{message}: {record.exc_info[1]!r}\n{trace}"
        except Exception:  # noqa: BLE001 - as in logging's own handlers: a wrong format is reported and does no harm
            self.handleError(record)
            return
        level: Level = next((name for number, name in _LEVELS.items() if record.levelno >= number), "debug")
        self._publish(LogEvent(self._now(), level, message, logger=record.name))


LOOK_EVERY = 0.2
"""Seconds of the clock between readings of the running leaves' feedback."""

TIME_DECIMALS = 6
"""Decimals of seconds, as many as a .btlog holds."""
OUTCOMES = {TerminationReason.CANCELLED: "cancelled", TerminationReason.ERROR: "error"}
"""Outcomes of executions that are not judged, as in ``result.json``."""


class Source(Protocol):
    """A source of events besides the tree; called in the executor's thread, with ``time`` and ``tick`` of events."""

    def begin(self, publish: Publish) -> None:
        """Begin recording or watching."""

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """Handle the end of a tick; ``wanted``: the subscribed topics."""

    def failed(self, time: float, node: str) -> None:
        """Handle the failure of an action."""


class Telemetry:
    """Publishes one execution while used as a context; it watches the executor.

    ``folder``: where the events are stored, if given; ``keeping`` is notified if writing fails. ``failures``: those
    reported by skills. ``sources``: further sources of events.
    """

    def __init__(
        self,
        executor: Executor,
        run: RunEvent,
        folder: Path | None = None,
        failures: Sequence[NodeFailure] = (),
        sources: Sequence[Source] = (),
        keeping: RecordingErrors | None = None,
    ) -> None:
        self.run = run
        self._keeping = keeping or RecordingErrors()
        self._executor, self._tree, self._folder = executor, executor.tree, folder
        self._sources = sources
        self._stream = EventStream()
        self._failures = FailureLines(failures)
        self.last_failure: NodeFailure | None = None
        """The latest failure of an action; None before the first one, and without folder and subscribers."""
        self.interventions: list[str] = []
        """Manual interventions: entries that were set, results that were forced."""
        self._start = executor.clock.now()
        self._taps: dict[Tree, TreeListener] = {}
        self._trees = 0
        self._blackboard = BlackboardChanges(self._tree)
        self._looked = 0.0
        self._subscribers: set[SubscriberQueue] = set()
        self._attached = False
        self._ended = False
        self._package_log = PackageLog(self.publish, self.now)

    def __enter__(self) -> Telemetry:
        log: RunLogWriter | None = None
        if self._folder is not None:
            try:
                log = RunLogWriter(self._folder, self._tree, self.run)
            except OSError as error:
                self._keeping.mark_lost(LOGS, error)
        self._stream.start(log, self._keeping)
        self._executor.watchers.append(self)
        if log is not None:
            self._attach()
        self._package_log.__enter__()
        self.log("info", f"{self.run.task} begins: tree {self.run.tree}, seed {self.run.seed}")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._ended:
            self.end("cancelled" if error is None else "error", "IDLE", "" if error is None else f"{error}")
        self._package_log.__exit__(kind, error, trace)
        self._detach()
        self._executor.watchers.remove(self)
        self._stream.close()

    @property
    def waiting(self) -> int:
        """Number of events not yet written and sent; beyond ``MAX_WAITING`` events are dropped."""
        return self._stream.waiting

    def now(self) -> float:
        """Return seconds of the clock since the start, as in events."""
        return round(self._executor.clock.now() - self._start, TIME_DECIMALS)

    def publish(self, event: Event) -> None:
        """Publish a finished event; thread-safe."""
        self._stream.publish(lambda: (event,))

    def log(self, level: Level, message: str) -> None:
        """Publish a line of the log."""
        self.publish(LogEvent(self.now(), level, message, logger=__name__))

    def intervened(self, what: str) -> None:
        """Record a manual intervention, which is logged and listed in the result."""
        self.interventions.append(f"{self.now():.2f} s: {what}")
        self.log("warning", f"by hand: {what}")

    def end(self, outcome: str, tree_status: str, why: str = "", time: float | None = None) -> None:
        """Publish the end of the run as judged; without this call, the execution's own end is published.

        ``time``: the end of the tree, seconds since the start; by default now.
        """
        self._ended = True
        time = self.now() if time is None else round(time, TIME_DECIMALS)
        level: Level = "info" if outcome == "success" else "error"
        message = f"{self.run.task} ends: {outcome}" + (f": {why}" if why else "")
        self.publish(LogEvent(time, level, message, logger=__name__))
        self.publish(EndEvent(time, outcome, tree_status, why))

    def end_as(self, execution: Execution) -> None:
        """Publish the end of a run that is not judged."""
        outcome = "success" if execution.succeeded else OUTCOMES.get(execution.ending, "failure")
        self.end(outcome, execution.tree_status, execution.why)

    def subscribe(self, outbox: SubscriberQueue, topics: frozenset[Topic]) -> None:
        """Subscribe ``outbox``: send the current state, then new events of ``topics``; see ``EventStream.add``."""
        self._subscribers.add(outbox)
        self._stream.add(outbox, topics)
        self._executor.between_ticks(self._attach)

    def forget(self, outbox: SubscriberQueue) -> None:
        """Remove a subscriber."""
        self._subscribers.discard(outbox)
        self._stream.forget(outbox)

    def after_tick(self) -> None:
        """Implement ``ExecutionWatcher``."""
        if not self._attached:
            return
        time, tick = self.now(), self._executor.ticks
        self._publish_blackboard(time, tick)
        for source in self._sources:
            source.after_tick(time, tick, self._stream.wanted)
        if time - self._looked >= LOOK_EVERY:
            self._looked = time
            self._look()
            if self._folder is None and not self._subscribers:
                self._detach()

    def entries_set(self) -> None:
        """Publish entries written from outside between ticks, even while the execution is paused."""
        if self._attached:
            self._publish_blackboard(self.now(), self._executor.ticks)

    def held(self, hold: PauseReason | None) -> None:
        """Implement ``ExecutionWatcher``."""
        if hold is None:
            self.publish(ResumedEvent(self.now()))
            return
        time, tick = self.now(), self._executor.ticks + (hold.node is not None)
        if self._attached:
            self._publish_blackboard(time, tick)
            self.publish(StatesEvent(time, tick, []))  # a step that changed nothing was a tick, too
        self.publish(PausedEvent(time, hold.reason, hold.node, hold.when, hold.words, hold.swept))

    def _attach(self) -> None:
        if self._attached:
            return
        self._attached = True
        self.publish(self.run)
        self._tap(self._tree)
        self._tree.subscribe_to_inner(self._tap)
        for source in self._sources:
            source.begin(self._stream.publish)
        self._blackboard = BlackboardChanges(self._tree)
        self._publish_blackboard(self.now(), self._executor.ticks)

    def _detach(self) -> None:
        self._attached = False
        self._tree.unsubscribe_from_inner(self._tap)
        for tap in self._taps.values():
            tap.detach()
        self._taps.clear()
        self._trees = 0
        self._stream.begin_anew()

    def _tap(self, tree: Tree, under: Node | None = None) -> None:
        number = 0 if under is None else self._trees
        self._taps[tree] = tap = TreeListener(tree, self._stream.publish, self._moment, self._failed, number, under)
        self._trees += 1
        tap.attach()

    def _look(self) -> None:
        for tree, tap in list(self._taps.items()):
            tap.look()
            if tree is not self._tree and tree.status != RUNNING:
                tap.detach()
                del self._taps[tree]

    def _moment(self, stamp: float) -> tuple[float, int]:
        return round(stamp - self._start, TIME_DECIMALS), self._executor.ticks

    def _publish_blackboard(self, time: float, tick: int) -> None:
        written = self._blackboard.collect()
        if written:
            self._stream.publish(lambda: (blackboard_event(time, tick, written),))

    def _failed(self, tree: Tree, uids: list[int]) -> None:
        time = self.now()
        for line in self._failures.of(tree, uids):
            self.last_failure = line
            obstacle = line.obstacle
            self.publish(
                LogEvent(time, "warning", line.why, line.node, line.error_code, where=line.where, obstacle=obstacle)
            )
            for source in self._sources:
                source.failed(time, line.node)


LONGEST_MESSAGE = 2000
"""Largest number of characters of a node's feedback."""


class TreeListener:
    """Publishes the states of a tree and the feedback of its leaves.

    ``publish``: receives a function that creates events, and returns False if it was dropped; ``moment``: converts a
    clock time to time and tick count of events; ``failed``: called with the uids of failed actions.
    """

    def __init__(
        self,
        tree: Tree,
        publish: Publish,
        moment: Callable[[float], tuple[float, int]],
        failed: Callable[[Tree, list[int]], None],
        number: int = MAIN_TREE,
        under: Node | None = None,
    ) -> None:
        self._tree, self._publish, self._moment, self._failed = tree, publish, moment, failed
        self._number, self._under = number, under
        leaves = [node for node in tree.nodes if not node.children]
        self._leaves = leaves
        self._speaking = frozenset(
            state_code(node.uid, state) for node in leaves for state in (RUNNING, SUCCESS, FAILURE)
        )
        self._failures = failure_codes(tree)
        self._said: dict[int, str] = {}
        self._lost = False

    def attach(self) -> None:
        """Start publishing, with the tree and its current state."""
        above = None if self._under is None else self._under.uid
        self._publish(lambda: (describe_tree(self._tree, self._number, above),))
        self._tree.subscribe(self._listen)
        self._publish_all()

    def detach(self) -> None:
        """Stop listening."""
        self._tree.unsubscribe(self._listen)

    def look(self) -> None:
        """Publish new feedback of running leaves, and all states if events were dropped."""
        if self._lost:
            self._lost = False
            self._publish_all()
        said, news = self._said, {}
        for node in self._leaves:
            moved = node.tree is not self._tree  # into a tree that has taken the place of this one
            if node._s == RUNNING and not moved and node.feedback_message != said.get(node.uid, ""):
                news[node.uid] = said[node.uid] = node.feedback_message
        if news:
            self._states(*self._moment(self._tree.clock.now()), (), news)

    def _publish_all(self) -> None:
        nodes = self._tree.nodes
        codes = [state_code(node.uid, node.state) for node in nodes]
        messages = {node.uid: node.feedback_message for node in nodes if node.feedback_message}
        self._states(*self._moment(self._tree.clock.now()), codes, messages)

    def _listen(self, changes: StateChanges) -> None:
        nodes, codes, messages = self._tree.nodes, changes.codes, {}
        for code in self._speaking.intersection(codes):
            uid, _ = uid_and_state(code)
            message = nodes[uid - 1].feedback_message
            if message:
                messages[uid] = self._said[uid] = message
        time, ticks = self._moment(changes.stamp)
        self._states(time, ticks + 1, codes, messages)  # of the tick under way
        if not self._failures.isdisjoint(codes):
            self._failed(self._tree, [uid_and_state(code)[0] for code in codes if code in self._failures])

    def _states(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> None:
        self._lost |= not self._publish(partial(self._event, time, tick, codes, messages))

    def _event(self, time: float, tick: int, codes: Iterable[int], messages: dict[int, str]) -> tuple[Event]:
        changes = [uid_and_state(code) for code in codes]
        short = {uid: text[:LONGEST_MESSAGE] for uid, text in messages.items()}
        return (StatesEvent(time, tick, changes, short, self._number),)


class WrittenEntry(NamedTuple):
    """The current state of an entry; ``scope``: path of its SubTree; ``exists``: False if it was removed."""

    scope: str
    key: str
    exists: bool
    value: Any
    kind: Any


class BlackboardChanges:
    """Compares the entries' sequence numbers and stamps, so that writers are not slowed down.

    It uses both, because the sequence number of a removed entry starts again at 1.
    """

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._seen: dict[Slot, tuple[int, float] | None] = {}

    def collect(self) -> list[WrittenEntry]:
        """Return the entries written since the last call; the first call returns all entries."""
        seen, written = self._seen, []
        for scope, board in self._tree.blackboards.items():
            for slot in board.slots():
                version = (slot.sequence, slot.stamp) if slot.exists else None
                if seen.get(slot) != version:
                    seen[slot] = version
                    written.append(WrittenEntry(scope, slot.key, slot.exists, slot.value, slot.kind))
        return written


def blackboard_event(time: float, tick: int, written: list[WrittenEntry]) -> BlackboardEvent:
    """Return the event of written entries; it formats the values here, which may take time."""
    entries: dict[str, dict[str, ShownEntry]] = {}
    for entry in written:
        shown = show_value(entry.value, entry.kind) if entry.exists else REMOVED
        entries.setdefault(entry.scope, {})[entry.key] = shown
    return BlackboardEvent(time, tick, entries)
