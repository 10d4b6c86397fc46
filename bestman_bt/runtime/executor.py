"""The executor: ticks a tree until it ends, is cancelled or times out; supports pause and step."""

from __future__ import annotations

import logging
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import StrEnum
from types import FrameType
from typing import Literal, Protocol

from bestman_bt.engine import IDLE, RUNNING, EngineError, NodeError, Tree, status_name
from bestman_bt.engine.clock import EngineClock
from bestman_bt.engine.own_files import describe_error
from bestman_bt.errors import InputError
from hal.api import RobotError

MAX_WAKE_UPS = 1000
"""Largest number of consecutive ticks without progress of the clock."""
MAX_TASKS = 16
"""Largest number of tasks between two ticks; the rest waits for the next tick."""
WRAP_UP_TIME = 5.0
"""Seconds after an interrupt during which further ones do not abort the stopping of the robot and the writing of
results.
"""
PAUSE_POLL = 0.05
"""Seconds between checks of a paused executor for cancellation and tasks."""
_KNOWN = (EngineError, RobotError)
"""Errors whose message needs no type and place."""


class TerminationReason(StrEnum):
    """The reason why an execution ended."""

    FINISHED = "finished"  # the root returned SUCCESS or FAILURE
    CANCELLED = "cancelled"  # on request: Ctrl-C, the control channel, ``cancel()``
    TIMEOUT = "timeout"  # the time limit was reached
    ERROR = "error"  # a node raised, or the robot did between ticks


@dataclass(frozen=True)
class Execution:
    """The result of an execution. ``tree_status``: SUCCESS, FAILURE or IDLE (halted). ``why``: the reason, if it did
    not finish.
    """

    ending: TerminationReason
    tree_status: str
    ticks: int
    sim_time_s: float
    wall_time_s: float
    why: str = ""

    @property
    def succeeded(self) -> bool:
        """Whether the tree ended with SUCCESS."""
        return self.tree_status == "SUCCESS"


@dataclass(frozen=True)
class PauseReason:
    """The reason why an execution waits: for a breakpoint, ``node`` (path) and ``when``.

    ``words`` and ``swept`` (outlines in the map frame, metres): the motion that a person has to confirm.
    """

    reason: Literal["asked", "breakpoint", "confirm"] = "asked"
    node: str | None = None
    when: Literal["before", "after"] | None = None
    words: str = ""
    swept: list[list[tuple[float, float]]] = field(default_factory=list)


class ExecutionWatcher(Protocol):
    """Callbacks of an execution, called in the executor's thread."""

    def after_tick(self) -> None:
        """Handle the end of a tick."""

    def held(self, hold: PauseReason | None) -> None:
        """Handle a pause, with its reason, or its end, with None. Optional."""
        return


class Executor:
    """Runs one tree on one clock.

    ``period``: seconds between ticks. ``time_limit``: seconds of the clock, without pauses. ``after_tick``: called
    after each tick. ``watchers``: also notified of pauses. ``cancel``, ``pause``, ``resume`` and ``step`` are
    thread-safe.
    """

    def __init__(
        self,
        tree: Tree,
        clock: EngineClock,
        *,
        period: float = 0.05,
        time_limit: float | None = None,
        after_tick: Callable[[], None] | None = None,
    ) -> None:
        self.tree = tree
        self.clock = clock
        self.period = period
        self.time_limit = time_limit
        self.after_tick = after_tick
        self.watchers: list[ExecutionWatcher] = []
        self.ticks = 0
        self._cancel_reason = ""
        self._looping = self._over = False
        self._interrupted_at: float | None = None  # monotonic seconds
        self._go = threading.Event()
        self._go.set()
        self._hold: PauseReason | None = None
        self._step = False
        self._stepping = False  # whether the tick under way is the step that was asked for
        self._stepped = threading.Event()
        self._wake_ups = 0
        self._waited = 0.0  # seconds of the clock that this run has been paused for
        self._tasks: deque[tuple[Callable[[], None], Future[None]]] = deque()

    def cancel(self, reason: str = "cancelled on request") -> None:
        """End the execution: no further node of the tree is ticked. The first reason is kept."""
        self._cancel_reason = self._cancel_reason or reason
        self.tree.refuse_ticks()
        self._go.set()
        self.tree.wake_up()

    def pause(self) -> None:
        """Pause ticking until ``resume`` or ``step``; in simulation the clock stops."""
        self._go.clear()

    def resume(self) -> None:
        """Continue ticking, also after a ``step`` whose tick is held."""
        self._step = False
        self._go.set()

    def step(self) -> None:
        """Execute one tick, then pause again."""
        self._stepped.clear()
        self._step = True
        self._go.set()

    def wait_for_step(self, timeout: float) -> bool:
        """Wait up to ``timeout`` seconds; return whether the tick of the last ``step`` has ended or is held at a
        breakpoint.
        """
        return self._stepped.wait(timeout)

    @property
    def paused(self) -> bool:
        """Whether the execution is paused."""
        return not self._go.is_set()

    @property
    def held_at(self) -> PauseReason | None:
        """Where and why the execution waits, or None while it is running."""
        return self._hold

    def hold(self, hold: PauseReason) -> None:
        """Wait within a tick until ``resume`` or ``step``; for calls in the executor's thread.

        In simulation the clock stops; on hardware, current motions are paused as well.

        Raises:
            EngineError: the execution was cancelled meanwhile.
        """
        self._step = False  # a step ends here
        self._hold = hold  # before the pause: who sees that is to see the reason, too
        self._go.clear()
        self._stepped.set()
        self.tree.publish()
        self._wait_for_turn(hold)
        self._stepping = self._step
        self.tree.raise_if_refused()

    def between_ticks(self, task: Callable[[], None]) -> Future[None]:
        """Run ``task`` in the executor's thread before the next tick or during a pause; the future gets its exception.

        The future is cancelled if the execution ends first; the caller may cancel it until it starts.
        """
        future: Future[None] = Future()
        self._tasks.append((task, future))
        return future

    def run(self) -> Execution:
        """Tick until the end and return the result; the tree is always halted at the end."""
        start, wall_start = self.clock.now(), time.perf_counter()
        ending, status, why = TerminationReason.FINISHED, IDLE, ""
        self.tree.allow_ticks()  # the reason of an earlier ``cancel`` is seen before the first one
        self._over, self._waited = False, 0.0
        with self.interrupts():
            try:
                self._looping = True
                try:
                    ending, status, why = self._loop(start)
                finally:
                    self._looping = False
            except InputError:  # reported by the caller
                raise
            except (Exception, SystemExit) as error:  # a user's code may raise anything; reported and logged below
                if isinstance(error, NodeError):
                    logging.getLogger(__name__).error("the tick went through %s", " > ".join(error.backtrace))
                ending, why = TerminationReason.ERROR, _described(error)
                if self._cancel_reason:
                    ending, why = TerminationReason.CANCELLED, self._cancel_reason
                elif not isinstance(error, _KNOWN) or error.__cause__ is not None:
                    logging.getLogger(__name__).error("the execution ended in an error", exc_info=error)
            except KeyboardInterrupt:  # in the middle of a tick
                if not self._cancel_reason:
                    raise
                ending, why = TerminationReason.CANCELLED, self._cancel_reason
            finally:
                if status == IDLE and (fault := self._halt()) and ending is TerminationReason.TIMEOUT:
                    ending, why = TerminationReason.ERROR, fault
                self._shut_down()
                while self._tasks:
                    self._tasks.popleft()[1].cancel()
                self._stepped.set()
                self._over = True
        elapsed = self.clock.now() - start
        return Execution(ending, status_name(status), self.ticks, elapsed, time.perf_counter() - wall_start, why)

    def _halt(self) -> str:
        """Halt the tree and wait until it has stopped; log and return the failure of a node that could not be."""
        try:
            self.tree.halt()
            self.tree.wait_until_stopped(self.period)
        except (Exception, SystemExit) as error:  # as in a tick
            logging.getLogger(__name__).error("the tree was not halted properly", exc_info=error)
            return _described(error)
        return ""

    def _shut_down(self) -> None:
        """Shut native py_trees behaviours down; a failure is logged, since the tree has its result already."""
        try:
            self.tree.shutdown()
        except EngineError as error:
            logging.getLogger(__name__).error("%s", error)

    def _loop(self, start: float) -> tuple[TerminationReason, int, str]:
        while True:
            self._wait_for_turn()
            if self._cancel_reason:
                return TerminationReason.CANCELLED, IDLE, self._cancel_reason
            self._stepping = self._step
            status = self.tree.tick_exactly_once()
            self.ticks += 1
            if self.after_tick is not None:
                self.after_tick()
            for watcher in self.watchers:
                watcher.after_tick()
            if self._cancel_reason:  # a stopped robot makes skills fail: that is not the tree's own failure
                return TerminationReason.CANCELLED, IDLE, self._cancel_reason
            if status != RUNNING:
                return TerminationReason.FINISHED, status, ""
            if self.time_limit is not None and self.clock.now() - start - self._waited >= self.time_limit:
                return TerminationReason.TIMEOUT, IDLE, f"not done within {self.time_limit:g} s"
            if self._stepping:
                self._step = self._stepping = False
                self._go.clear()
                self._stepped.set()
            self._sleep()

    def _sleep(self) -> None:
        """Sleep for a period, or not at all if a node has woken the loop, but let time pass even if nodes wake it
        endlessly.
        """
        before = self.clock.now()
        self.tree.sleep(self.period)
        self._wake_ups = self._wake_ups + 1 if self.clock.now() == before else 0
        if self._wake_ups >= MAX_WAKE_UPS:
            self._wake_ups = 0
            self.clock.sleep(self.period)

    def _wait_for_turn(self, hold: PauseReason = PauseReason()) -> None:
        """Run the tasks between ticks; while paused, wait."""
        waits, begun = False, self.clock.now()
        while True:
            self._do_tasks()
            if self._cancel_reason or self._go.is_set():
                break
            if not waits:
                waits = True
                self._notify(hold)
            self._go.wait(PAUSE_POLL)
        if waits:
            self._waited += self.clock.now() - begun
            self._notify(None)

    def _notify(self, hold: PauseReason | None) -> None:
        self._hold = hold
        for watcher in self.watchers:
            watcher.held(hold)

    def _do_tasks(self) -> None:
        for _ in range(min(len(self._tasks), MAX_TASKS)):
            task, future = self._tasks.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                task()
            except Exception as error:  # noqa: BLE001 - it belongs to the one who asked
                future.set_exception(error)
            else:
                future.set_result(None)

    @contextmanager
    def interrupts(self) -> Iterator[None]:
        """Let the first Ctrl-C or termination signal cancel between ticks, and a second one interrupt a tick.

        If still active after ``run()``, during the wrap-up of a cancelled execution, it ignores further signals for at
        most ``WRAP_UP_TIME`` seconds.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def interrupted(number: int, frame: FrameType | None) -> None:
            if not self._cancel_reason and not self._over:
                # Only these: the handler may run while this thread holds the lock of an event that ``cancel`` would set
                self._cancel_reason = "interrupted from the keyboard" if number == signal.SIGINT else "terminated"
                self._interrupted_at = time.monotonic()
                self.tree.refuse_ticks()
            elif self._looping:
                self._looping = False
                raise KeyboardInterrupt
            elif not self._cancel_reason or self._wrap_up_took_long():
                raise KeyboardInterrupt

        before = {number: signal.signal(number, interrupted) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _wrap_up_took_long(self) -> bool:
        if self._interrupted_at is None:
            self._interrupted_at = time.monotonic()
        return time.monotonic() - self._interrupted_at > WRAP_UP_TIME


def _described(error: BaseException) -> str:
    return str(error) if isinstance(error, _KNOWN) else describe_error(error)
