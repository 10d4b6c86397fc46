"""CoroutineAction: an action written as one ``async def`` that pauses between ticks."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Coroutine, Generator
from typing import Any

from bestman_bt.engine.leaves.base import StatefulAction
from bestman_bt.engine.status import RUNNING


class _NextTick:
    """Awaiting it ends this tick as RUNNING."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class CoroutineAction(StatefulAction):
    """An action whose ``run_async()`` goes on until it awaits, each tick; no thread and no event loop is involved.

    Inside it: ``await self.next_tick()``, ``await self.sleep(seconds)`` (of the tree's clock) and
    ``await self.until(condition)``. A halt raises ``GeneratorExit`` at the await: clean up in ``finally``.
    """

    _coroutine: Coroutine[Any, Any, int] | None = None

    async def run_async(self) -> int:
        """Do the work and return a status other than RUNNING."""
        raise NotImplementedError(f"{type(self).__name__} does not define run_async()")

    def next_tick(self) -> Awaitable[None]:
        """Return what to await to be RUNNING until the next tick."""
        return _NextTick()

    async def sleep(self, seconds: float) -> None:
        """Be RUNNING for ``seconds`` of the tree's clock."""
        end = self.clock.now() + seconds
        while self.clock.now() < end:
            await _NextTick()

    async def until(self, condition: Callable[[], bool]) -> None:
        """Be RUNNING until ``condition()`` holds."""
        while not condition():
            await _NextTick()

    def on_start(self) -> int:
        """Begin."""
        self._coroutine = self.run_async()
        return self._step()

    def on_running(self) -> int:
        """Go on."""
        return self._step()

    def on_halted(self) -> None:
        """End the coroutine where it waits."""
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
        except BaseException:
            self._coroutine = None
            raise
        return RUNNING
