"""Loops: tick the child once for each item of a list or queue."""

from __future__ import annotations

from collections import deque
from typing import Any

from bestman_bt.engine.conversion import cast
from bestman_bt.engine.core.ports import In, InOut, Out, key_of
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.errors import ConversionError
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SKIPPED, SUCCESS, NodeStatus


class ForEach(Decorator):
    """Ticks the child for each item of ``items``, written to ``item``; FAILURE as soon as the child fails.

    The list is read when the node starts; SUCCESS after the last item, or if the list is empty. Items whose child
    returned SKIPPED count as done.
    """

    items = In(list[Any], "the items")
    item = Out(Any, "the current item")
    index = Out(int, "its position, from 0")
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Start before the first item."""
        self.given: list[Any] = []
        self.position = 0

    def on_tick(self) -> int:
        """Continue with the current item; between two items of one tick each, return RUNNING and wake the loop."""
        if self._s <= IDLE:
            self.given = list(self.items)
            self.position = 0
            self.set_state(RUNNING)
        child = self.child
        while self.position < len(self.given):
            was_idle = child._s <= IDLE
            if was_idle:
                self.index = self.position
                self.item = self.given[self.position]
            status = child.execute_tick()
            if status == RUNNING:
                return RUNNING
            self.reset_child()
            if status == FAILURE:
                return FAILURE
            self.position += 1
            if was_idle and status != SKIPPED and self.position < len(self.given):
                self.wake_up()
                return RUNNING
        return SUCCESS


class ConsumeQueue(Decorator):
    """Takes items from the ``deque`` at ``queue`` and ticks the child for each, several per tick; fails if the child
    fails.
    """

    queue = In(deque, "a collections.deque, emptied in place", required=False)
    popped_item = Out(Any, "the current item")
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Start with an idle child."""
        self.child_runs = False

    def halt(self) -> None:
        """Halt the child."""
        self.child_runs = False
        super().halt()

    def on_tick(self) -> int:
        """Finish the current item, then take further items until the child runs or fails."""
        result = SUCCESS
        if self.child_runs:
            result = self._tick_child()
            if result in (RUNNING, FAILURE):
                return result
        queue = self.queue
        while queue:
            self.set_state(RUNNING)
            self.popped_item = queue.popleft()
            status = self._tick_child()
            if status in (RUNNING, FAILURE):
                return status
            result = status
        return result

    def _tick_child(self) -> int:
        status = self.child.execute_tick()
        self.child_runs = status == RUNNING
        if status != RUNNING:
            self.reset_child()
        return status


class Loop(Decorator):
    """Takes items from ``queue`` one by one, writes each to ``value`` and ticks the child; fails if the child fails.

    A ``deque`` on the blackboard is emptied in place; a list, or a text with items separated by ``;``, is copied when
    the loop starts.
    """

    queue = InOut(Any, "the items")
    if_empty = In(
        NodeStatus, "Status to return if queue is empty: SUCCESS, FAILURE, SKIPPED", default=NodeStatus.SUCCESS
    )
    value: Any = Out(Any, "the current item")
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Convert the items if they are a literal."""
        self.child_runs = False
        self.left: deque[Any] | None = None
        self.literal: list[Any] | None = None
        if key_of(self.attributes["queue"], "queue") is None:
            self.literal = list(self._items(self.attributes["queue"]))

    def _items(self, value: Any) -> deque[Any]:
        converters, item_type = self.board.store.converters, type(self).value.information.data_type
        try:
            if isinstance(value, str):
                value = value.removesuffix(";").split(";") if value else []
            return deque(cast(item, item_type, converters) for item in value)
        except ConversionError as error:
            raise self.error(f"port 'queue': {error}") from error
        except TypeError as error:
            raise self.error(f"port 'queue': expected a list of items but got {value!r}") from error

    def on_tick(self) -> int:
        """Pop the next item unless the child is still running, and tick the child."""
        if self._s <= IDLE:
            self.child_runs = False
            self.left = None if self.literal is None else deque(self.literal)
        if not self.child_runs:
            queue = self._current_queue()
            if not queue:
                return int(self.if_empty)
            self.value = queue.popleft()
        if self._s <= IDLE:
            self.set_state(RUNNING)
        status = self.child.execute_tick()
        self.child_runs = status == RUNNING
        if status in (SUCCESS, FAILURE):
            self.reset_child()
        return FAILURE if status == FAILURE else RUNNING

    def _current_queue(self) -> deque[Any] | None:
        if self.literal is None:
            key = key_of(self.attributes["queue"], "queue")
            value = None if key is None else self.board.slot(key).value
            if value is None:
                raise self.error(f"port 'queue': the entry '{self.attributes['queue']}' has no value yet")
            if isinstance(value, deque):
                self.left = value
            elif self.left is None:
                self.left = self._items(value)
        return self.left


class LoopInt(Loop):
    """A loop over integers."""

    value = Out(int, "the current item")


class LoopDouble(Loop):
    """A loop over numbers."""

    value = Out(float, "the current item")


class LoopBool(Loop):
    """A loop over booleans."""

    value = Out(bool, "the current item")


class LoopString(Loop):
    """A loop over strings."""

    value = Out(str, "the current item")
