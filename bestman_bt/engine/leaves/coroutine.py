"""Actions that do not block the tick: a coroutine that pauses between ticks, and work in a separate thread."""

from __future__ import annotations

import threading
from collections.abc import Awaitable, Callable, Coroutine, Generator
from typing import Any

from bestman_bt.engine.leaves.base import StatefulAction
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


class ThreadedAction(StatefulAction):
    """An action whose ``on_work()`` runs in a thread; the node is RUNNING meanwhile.

    Read the inputs in ``prepare()``, on the tick thread, and return them for ``on_work``. ``on_work`` must check
    ``halt_requested`` often and return soon once it is set, because a halt waits for it. Its end wakes the tick loop.
    Threads make a simulation depend on the machine's load; use them with hardware.
    """

    _thread: threading.Thread | None = None

    def prepare(self) -> Any:
        """Return the inputs of ``on_work``; called on the tick thread."""
        return None

    def on_work(self, inputs: Any) -> int:
        """Do the work and return SUCCESS or FAILURE; called in the thread."""
        raise NotImplementedError(f"{type(self).__name__} does not define on_work()")

    @property
    def halt_requested(self) -> bool:
        """Whether the work should end now, because the node was halted."""
        return self._halt.is_set()

    def on_load(self) -> None:
        """Create the state that the threads share."""
        self._halt = threading.Event()
        self._result: int | None = None
        self._failure: BaseException | None = None
        self._done = False

    def on_start(self) -> int:
        """Start the thread."""
        self._halt.clear()
        self._result = self._failure = None
        self._done = False
        self._thread = threading.Thread(target=self._run, args=(self.prepare(),), name=self.path, daemon=True)
        self._thread.start()
        return RUNNING

    def _run(self, inputs: Any) -> None:
        try:
            self._result = self.on_work(inputs)
        except BaseException as error:  # noqa: BLE001 - handed to the tick thread, which raises it
            self._failure = error
        self._done = True  # before the wake-up: the thread may still be alive when the loop looks
        self.wake_up()

    def on_running(self) -> int:
        """Return the result once the thread has ended. Raises the error that it raised, or NodeError for an invalid
        result.
        """
        if not self._done:
            return RUNNING
        self._thread = None
        if isinstance(self._failure, Exception):
            raise self._failure
        if self._failure is not None:
            raise self.error(f"its on_work() ended with {self._failure!r}")
        if self._result not in (SUCCESS, FAILURE, SKIPPED):
            raise self.error(f"its on_work() returned {self._result!r}; SUCCESS, FAILURE or SKIPPED are accepted")
        return self._result

    def on_halted(self) -> None:
        """Ask the thread to end, and wait for it."""
        self._halt.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None


class _NextTick:
    """Awaiting it ends this tick as RUNNING."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class CoroutineAction(StatefulAction):
    """An action whose ``run_async()`` continues at each tick until it awaits; without a thread or an event loop.

    Inside it: ``await self.next_tick()``, ``await self.sleep(seconds)`` (of the tree's clock) and ``await
    self.until(condition)``. A halt raises ``GeneratorExit`` at the await: clean up in ``finally``.
    """

    _coroutine: Coroutine[Any, Any, int] | None = None

    async def run_async(self) -> int:
        """Do the work; return SUCCESS, FAILURE or SKIPPED."""
        raise NotImplementedError(f"{type(self).__name__} does not define run_async()")

    def next_tick(self) -> Awaitable[None]:
        """Return an awaitable that keeps the node RUNNING until the next tick."""
        return _NextTick()

    async def sleep(self, seconds: float) -> None:
        """Keep the node RUNNING for ``seconds`` of the tree's clock."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            await _NextTick()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Keep the node RUNNING until ``condition()`` is true."""
        while not condition():
            await _NextTick()

    def on_start(self) -> int:
        """Start the coroutine."""
        self._coroutine = self.run_async()
        return self._step()

    def on_running(self) -> int:
        """Continue the coroutine."""
        return self._step()

    def on_halted(self) -> None:
        """Close the coroutine where it waits. Raises NodeError if its cleanup fails."""
        coroutine, self._coroutine = self._coroutine, None
        if coroutine is None:
            return
        try:
            coroutine.close()
        except RuntimeError as error:
            raise self.error(f"its run_async() failed while it was halted: {error}") from error

    def _step(self) -> int:
        assert self._coroutine is not None
        try:
            self._coroutine.send(None)
        except StopIteration as done:
            self._coroutine = None
            result = done.value
            if result == RUNNING or not isinstance(result, int):
                raise self.error(
                    f"its run_async() returned {result!r}; SUCCESS, FAILURE or SKIPPED are accepted"
                ) from None
            return result
        return RUNNING
