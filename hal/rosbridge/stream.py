"""The newest message of a topic, and how old it is."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, Generic, TypeVar

from hal.api import Clock, NoDataError
from hal.hardware import LatencyMonitor, RemoteTime
from hal.rosbridge.decoding import Message, stamp

Value = TypeVar("Value")


class Stream(Generic[Value]):
    """One topic. ``decode(message, stamp)`` gives its value, None where the message is about something else.

    ``ros_time``: shared by all streams of a connection. ``longest_age``: seconds after which the newest value counts as
    none. Written by the link's thread, read by any.
    """

    def __init__(
        self,
        part: str,
        topic: str,
        decode: Callable[[Message, float], Value | None],
        clock: Clock,
        ros_time: RemoteTime,
        longest_age: float,
        header: Callable[[Message], Mapping[str, Any]] = lambda message: message["header"],
    ) -> None:
        self.part, self.topic, self.longest_age = part, topic, longest_age
        self._decode, self._clock, self._ros_time, self._header = decode, clock, ros_time, header
        self._arrived = threading.Condition()
        self._newest: tuple[Value, float] | None = None
        self._lateness = LatencyMonitor()

    def take(self, message: Message, received: float) -> None:
        """A message has come; raises what ``decode`` raises."""
        told = stamp(self._header(message))
        at = self._ros_time.here(told, received) if told > 0.0 else received
        value = self._decode(message, at)
        if value is None:
            return
        with self._arrived:
            self._lateness.lag = received - at
            self._newest = value, at
            self._arrived.notify_all()

    def forget(self) -> None:
        """Of a connection that has ended nothing is read."""
        self._newest = None
        self._lateness.forget()

    def read(self) -> Value:
        """The newest value; NoDataError where there is none or it is too old."""
        newest = self._newest
        if newest is None:
            raise NoDataError(f"{self.part}: nothing has come on {self.topic} yet")
        age = self._clock.now() - newest[1]
        if age > self.longest_age:
            raise NoDataError(f"{self.part}: what came last on {self.topic} is {age:.2f} s old")
        return newest[0]

    def latest(self) -> Value:
        """The newest value, however old: for who watches its age apart. NoDataError where there is none."""
        newest = self._newest
        if newest is None:
            raise NoDataError(f"{self.part}: nothing has come on {self.topic} yet")
        return newest[0]

    @property
    def age(self) -> float:
        """Seconds since the newest value was stamped."""
        newest = self._newest
        return self._clock.now() - newest[1] if newest is not None else float("inf")

    def late(self, longest_delay: float) -> float | None:
        """By how much messages have come late for a while, if that is more than ``longest_delay``, else None."""
        return self._lateness.late(longest_delay, self._clock.now())

    def newer_than(self, moment: float, deadline: float) -> tuple[Value, float] | None:
        """Wait until ``deadline`` (of the monotonic clock) for a value stamped after ``moment``; it and its stamp."""
        with self._arrived:
            while self._newest is None or self._newest[1] <= moment:
                left = deadline - time.monotonic()
                if left <= 0.0 or not self._arrived.wait(left):
                    return None
            return self._newest
