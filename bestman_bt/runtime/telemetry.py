"""Watches one execution from inside and tells it to its run folder and to whoever subscribes.

In the executor's thread only references are collected; events are made of them in the thread of an ``EventStream``.
Where nothing is kept and nobody watches, nothing is collected.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol

from behaviours.failure import NodeFailure
from bestman_bt.engine import RUNNING, Node, Tree
from bestman_bt.records.events import (
    EndEvent,
    Event,
    Level,
    LogEvent,
    PausedEvent,
    ResumedEvent,
    RunEvent,
    StatesEvent,
    Topic,
)
from bestman_bt.records.writer import RunLogWriter
from bestman_bt.runtime.blackboard_changes import BlackboardChanges, blackboard_event
from bestman_bt.runtime.event_stream import EventStream, Tell
from bestman_bt.runtime.executor import Ending, Execution, Executor, Hold
from bestman_bt.runtime.failure_lines import FailureLines
from bestman_bt.runtime.outbox import Outbox
from bestman_bt.runtime.package_log import PackageLog
from bestman_bt.runtime.tree_tap import TreeTap

LOOK_EVERY = 0.2
"""Seconds of the clock between looks at what running leaves say of themselves."""

TIME_DECIMALS = 6
"""Of seconds, as many as a .btlog holds."""
OUTCOMES = {Ending.CANCELLED: "cancelled", Ending.ERROR: "error"}
"""Of executions that a judge does not even look at, as in ``result.json``."""


class Source(Protocol):
    """What there is to tell besides the tree; called in the executor's thread, ``time`` and ``tick`` as in events."""

    def begin(self, tell: Tell) -> None:
        """Somebody keeps or watches from now on."""

    def after_tick(self, time: float, tick: int, wanted: frozenset[Topic]) -> None:
        """A tick has ended; ``wanted``: what is subscribed to."""

    def failed(self, time: float, node: str) -> None:
        """An action has failed."""


class Telemetry:
    """Tells of one execution while it is used as a context; it watches the executor.

    ``folder``: where the events are kept, if anywhere. ``told``: where skills tell of their failures. ``sources``: what
    else is told.
    """

    def __init__(
        self,
        executor: Executor,
        run: RunEvent,
        folder: Path | None = None,
        told: Sequence[NodeFailure] = (),
        sources: Sequence[Source] = (),
    ) -> None:
        self.run = run
        self._executor, self._tree, self._folder = executor, executor.tree, folder
        self._sources = sources
        self._stream = EventStream()
        self._failures = FailureLines(told)
        self.last_failure: NodeFailure | None = None
        """Of an action; None as long as none has failed, and where nobody watches and nothing is kept."""
        self._start = executor.clock.now()
        self._taps: dict[Tree, TreeTap] = {}
        self._trees = 0
        self._blackboard = BlackboardChanges(self._tree)
        self._looked = 0.0
        self._subscribers: set[Outbox] = set()
        self._attached = False
        self._ended = False
        self._package_log = PackageLog(self.tell, self.now)

    def __enter__(self) -> Telemetry:
        log = None if self._folder is None else RunLogWriter(self._folder, self._tree, self.run)
        self._stream.start(log)
        self._executor.watchers.append(self)
        if log is not None:
            self._attach()
        self._package_log.__enter__()
        self.say("info", f"{self.run.task} begins: tree {self.run.tree}, seed {self.run.seed}")
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
        """How much is not yet written and sent; beyond ``MAX_WAITING`` it is dropped."""
        return self._stream.waiting

    def now(self) -> float:
        """Seconds of the clock since the start, as events have them."""
        return round(self._executor.clock.now() - self._start, TIME_DECIMALS)

    def tell(self, event: Event) -> None:
        """Tell an event that is made already; from any thread."""
        self._stream.tell(lambda: (event,))

    def say(self, level: Level, message: str) -> None:
        """A line of the log."""
        self.tell(LogEvent(self.now(), level, message, logger=__name__))

    def end(self, outcome: str, tree_status: str, why: str = "", time: float | None = None) -> None:
        """How the run has ended, for whoever judges it; without it the execution's own end is told.

        ``time``: when its tree ended, seconds since the start; by default now.
        """
        self._ended = True
        time = self.now() if time is None else round(time, TIME_DECIMALS)
        level: Level = "info" if outcome == "success" else "error"
        message = f"{self.run.task} ends: {outcome}" + (f": {why}" if why else "")
        self.tell(LogEvent(time, level, message, logger=__name__))
        self.tell(EndEvent(time, outcome, tree_status, why))

    def end_as(self, execution: Execution) -> None:
        """How the run has ended where nobody judges it."""
        outcome = "success" if execution.succeeded else OUTCOMES.get(execution.ending, "failure")
        self.end(outcome, execution.tree_status, execution.why)

    # ---- subscribers, from threads of the control channel

    def subscribe(self, outbox: Outbox, topics: frozenset[Topic]) -> None:
        """Tell somebody how all stands and what happens; see ``EventStream.add``."""
        self._subscribers.add(outbox)
        self._stream.add(outbox, topics)
        self._executor.between_ticks(self._attach)

    def forget(self, outbox: Outbox) -> None:
        """Tell somebody nothing more."""
        self._subscribers.discard(outbox)
        self._stream.forget(outbox)

    # ---- in the executor's thread

    def after_tick(self) -> None:
        """As a watcher of the executor."""
        if not self._attached:
            return
        time, tick = self.now(), self._executor.ticks
        self._tell_blackboard(time, tick)
        for source in self._sources:
            source.after_tick(time, tick, self._stream.wanted)
        if time - self._looked >= LOOK_EVERY:
            self._looked = time
            self._look()
            if self._folder is None and not self._subscribers:
                self._detach()

    def entries_set(self) -> None:
        """Entries were written from outside, between ticks: told at once, also while the execution is paused."""
        if self._attached:
            self._tell_blackboard(self.now(), self._executor.ticks)

    def held(self, hold: Hold | None) -> None:
        """As a watcher of the executor."""
        if hold is None:
            self.tell(ResumedEvent(self.now()))
            return
        time, tick = self.now(), self._executor.ticks + (hold.node is not None)
        if self._attached:
            self._tell_blackboard(time, tick)
            self.tell(StatesEvent(time, tick, []))  # a step that changed nothing was a tick, too
        self.tell(PausedEvent(time, hold.reason, hold.node, hold.when))

    def _attach(self) -> None:
        if self._attached:
            return
        self._attached = True
        self.tell(self.run)
        self._tap(self._tree)
        self._tree.subscribe_to_inner(self._tap)
        for source in self._sources:
            source.begin(self._stream.tell)
        self._blackboard = BlackboardChanges(self._tree)
        self._tell_blackboard(self.now(), self._executor.ticks)

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
        self._taps[tree] = tap = TreeTap(tree, self._stream.tell, self._moment, self._failed, number, under)
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

    def _tell_blackboard(self, time: float, tick: int) -> None:
        written = self._blackboard.collect()
        if written:
            self._stream.tell(lambda: (blackboard_event(time, tick, written),))

    def _failed(self, tree: Tree, uids: list[int]) -> None:
        time = self.now()
        for line in self._failures.of(tree, uids):
            self.last_failure = line
            self.tell(LogEvent(time, "warning", line.why, line.node, line.error_code, where=line.where))
            for source in self._sources:
                source.failed(time, line.node)
