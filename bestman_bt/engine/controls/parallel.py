"""Parallel and ParallelAll: children side by side, within one thread."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from py_trees import composites
from py_trees.ports import PortInformation

from bestman_bt.engine.controls.base import NATIVE_POLICY, Control
from bestman_bt.engine.core.ports import In, key_of
from bestman_bt.engine.status import FAILURE, RUNNING, SKIPPED, SUCCESS


def _threshold(count: int, children: int) -> int:
    """Return how many children ``count`` means; a negative one counts from the number of children."""
    return max(children + count + 1, 0) if count < 0 else count


class _Counting(Control):
    """A node whose ports count children: how many are ``NEEDED``, and for what."""

    NEEDED: ClassVar[Mapping[str, str]]

    def on_load(self) -> None:
        """Refuse literals that count more children than there are."""
        for port in self.NEEDED:
            if key_of(self.attributes.get(port), port) is None:
                self.counted(port, self.get_input(port))

    def counted(self, port: str, given: int) -> int:
        """Return how many children the value of a port means. Raises NodeError if there are fewer."""
        children = len(self.children)
        count = _threshold(given, children)
        if children < count:
            there = "is 1 child" if children == 1 else f"are {children} children"
            raise self.error(f"{port} is {count} but there {there}; it cannot {self.NEEDED[port]}")
        return count


class Parallel(_Counting, composites.Parallel):
    """Ticks all unfinished children; the numbers of successes and failures decide, and the rest is halted."""

    success_count = In[int](
        PortInformation(int, True, "number of children that need to succeed to trigger a SUCCESS", -1)
    )
    failure_count = In[int](PortInformation(int, True, "number of children that need to fail to trigger a FAILURE", 1))
    NEEDED = {"success_count": "succeed", "failure_count": "fail"}
    policy: Any = NATIVE_POLICY

    def on_load(self) -> None:
        """Initialise without finished children."""
        super().on_load()
        self._clear()

    def _clear(self) -> None:
        self.done: set[int] = set()
        self.succeeded = 0
        self.failed = 0

    def halt(self) -> None:
        """Forget the finished children."""
        self._clear()
        super().halt()

    def on_tick(self) -> int:
        """Tick every unfinished child, in order."""
        children = self.nodes_below()
        success_count = self.success_count
        needed = self.counted("success_count", success_count)
        tolerated = self.counted("failure_count", self.failure_count)
        self.set_state(RUNNING)
        skipped = 0
        for index, child in enumerate(children):
            if index not in self.done:
                status = child.execute_tick()
                if status == SKIPPED:
                    skipped += 1
                elif status == SUCCESS:
                    self.done.add(index)
                    self.succeeded += 1
                elif status == FAILURE:
                    self.done.add(index)
                    self.failed += 1
            if self.succeeded >= needed or (success_count < 0 and self.succeeded + skipped >= needed):
                return self._end(SUCCESS)
            if len(children) - self.failed < needed or self.failed == tolerated:
                return self._end(FAILURE)
        return SKIPPED if skipped == len(children) else RUNNING

    def _end(self, status: int) -> int:
        self._clear()
        self.reset_children()
        return status


class ParallelAll(_Counting, composites.Parallel):
    """Ticks all children until each has finished; FAILURE if at least ``max_failures`` failed."""

    max_failures = In[int](
        PortInformation(
            int,
            True,
            "If the number of children returning FAILURE exceeds this value, ParallelAll returns FAILURE",
            1,
        )
    )
    NEEDED = {"max_failures": "fail"}
    policy: Any = NATIVE_POLICY

    def on_load(self) -> None:
        """Initialise without finished children."""
        super().on_load()
        self.done: set[int] = set()
        self.failed = 0

    def halt(self) -> None:
        """Forget the finished children."""
        self.done = set()
        self.failed = 0
        super().halt()

    def on_tick(self) -> int:
        """Tick every unfinished child, in order."""
        children = self.nodes_below()
        tolerated = self.counted("max_failures", self.max_failures)
        self.set_state(RUNNING)
        skipped = 0
        for index, child in enumerate(children):
            if index in self.done:
                continue
            status = child.execute_tick()
            if status == SKIPPED:
                skipped += 1
            elif status != RUNNING:
                self.done.add(index)
                self.failed += status == FAILURE
        if skipped == len(children):
            return SKIPPED
        if skipped + len(self.done) < len(children):
            return RUNNING
        self.reset_children()
        status = FAILURE if self.failed >= tolerated else SUCCESS
        self.done = set()
        self.failed = 0
        return status
