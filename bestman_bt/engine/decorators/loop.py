"""LoopInt, LoopDouble, LoopBool and LoopString: the child once for each item of a queue."""

from __future__ import annotations

from collections import deque
from typing import Any, ClassVar

from py_trees.ports import PortInformation

from bestman_bt.engine.conversion import cast
from bestman_bt.engine.decorators.base import Decorator
from bestman_bt.engine.errors import ConversionError
from bestman_bt.engine.ports import key_of
from bestman_bt.engine.status import FAILURE, IDLE, RUNNING, SUCCESS, NodeStatus


class Loop(Decorator):
    """Takes items from ``queue`` one by one, writes each to ``value`` and ticks the child; fails when it fails.

    A ``deque`` on the blackboard is emptied in place; a list, or a text with items separated by ``;``, is copied
    when the loop starts.
    """

    ITEM: ClassVar[Any] = Any
    INPUT_PORTS = {
        "queue": PortInformation(Any, True, "the items"),
        "if_empty": PortInformation(
            NodeStatus, False, "Status to return if queue is empty: SUCCESS, FAILURE, SKIPPED", NodeStatus.SUCCESS
        ),
    }
    OUTPUT_PORTS = {"queue": PortInformation(Any), "value": PortInformation(Any, False, "the current item")}
    RESETS_CHILD = True

    def on_load(self) -> None:
        """Convert the items where they are a literal."""
        self.child_runs = False
        self.queue: deque[Any] | None = None
        self.literal: list[Any] | None = None
        if key_of(self.attributes["queue"], "queue") is None:
            self.literal = list(self._items(self.attributes["queue"]))

    def _items(self, value: Any) -> deque[Any]:
        converters = self.board.store.converters
        try:
            if isinstance(value, str):
                value = value.removesuffix(";").split(";") if value else []
            return deque(cast(item, self.ITEM, converters) for item in value)
        except ConversionError as error:
            raise self.error(f"port 'queue': {error}") from error
        except TypeError as error:
            raise self.error(f"port 'queue': expected a list of items but got {value!r}") from error

    def on_tick(self) -> int:
        """Take the next item unless the child still runs, and tick the child."""
        if self._s <= IDLE:
            self.child_runs = False
            self.queue = None if self.literal is None else deque(self.literal)
        if not self.child_runs:
            queue = self._current_queue()
            if not queue:
                return int(self.get_input("if_empty"))
            self.set_output("value", queue.popleft())
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
                self.queue = value
            elif self.queue is None:
                self.queue = self._items(value)
        return self.queue


class LoopInt(Loop):
    """A loop over whole numbers."""

    ITEM = int
    OUTPUT_PORTS = {"value": PortInformation(int, False, "the current item")}


class LoopDouble(Loop):
    """A loop over numbers."""

    ITEM = float
    OUTPUT_PORTS = {"value": PortInformation(float, False, "the current item")}


class LoopBool(Loop):
    """A loop over truth values."""

    ITEM = bool
    OUTPUT_PORTS = {"value": PortInformation(bool, False, "the current item")}


class LoopString(Loop):
    """A loop over texts."""

    ITEM = str
    OUTPUT_PORTS = {"value": PortInformation(str, False, "the current item")}
