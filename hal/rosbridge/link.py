"""One websocket to a rosbridge server, by roslibpy; it never reconnects automatically, so that no command is delivered
late.
"""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any, Generic, TypeVar

from hal.api import Clock, NoDataError
from hal.hardware.clock import FARTHEST_AHEAD, FARTHEST_BEHIND, LatencyMonitor, RemoteTime, StampOrder, SynchronisedTime
from hal.hardware.control_loop import take_real_time_priority
from hal.parts.part_connection import ConnectionFailedError
from hal.rosbridge.decoding import Message, stamp

Value = TypeVar("Value")


class TopicStream(Generic[Value]):
    """The latest value of a topic. ``decode(message, stamp)`` returns the value, None if the message is about something
    else.

    ``ros_time``: shared by the streams of a part, whose stamps are compared. ``longest_age``: seconds after which a
    value is too old. ``header(message)``: returns its header, or None if the message is about something else.
    ``frame``: the ``frame_id`` of the newest value. Written by the link's thread, read by any.
    """

    def __init__(
        self,
        part: str,
        topic: str,
        decode: Callable[[Message, float], Value | None],
        clock: Clock,
        ros_time: RemoteTime,
        longest_age: float,
        header: Callable[[Message], Mapping[str, Any] | None] = lambda message: message["header"],
    ) -> None:
        self.frame = ""
        self._order = StampOrder()
        self.part, self.topic, self.longest_age = part, topic, longest_age
        self._decode, self._clock, self._ros_time, self._header = decode, clock, ros_time, header
        self._arrived = threading.Condition()
        self._newest: tuple[Value, float] | None = None
        self._lateness = LatencyMonitor()

    def take(self, message: Message, received: float) -> None:
        """Process a message. Raises what ``decode`` raises."""
        header = self._header(message)
        if header is None:
            return
        stamped = stamp(header)
        set_back = self._order.set_back(stamped)
        at = self._ros_time.tried(stamped, received) if stamped > 0.0 and not set_back else received
        value = self._decode(message, at)
        if value is None:
            return
        if stamped > 0.0:
            if set_back:
                self._ros_time.forget()
            self._order.note(stamped)
            at = self._ros_time.here(stamped, received)
        self.frame = str(header.get("frame_id", ""))
        with self._arrived:
            self._lateness.lag = received - at
            self._newest = value, at
            self._arrived.notify_all()

    def forget(self) -> None:
        """Discard the readings of an ended connection."""
        self._newest = None
        self.forget_time()

    def forget_time(self) -> None:
        """Discard the clock offset: ROS's clock may have changed."""
        self._lateness.forget()
        self._order.forget()
        self._ros_time.forget()

    def read(self) -> Value:
        """Return the newest value. Raises NoDataError if there is none or it is too old."""
        newest = self._newest
        if newest is None:
            raise NoDataError(f"{self.part}: no message on {self.topic} yet", self.part)
        age = self._clock.now() - newest[1]
        if age > self.longest_age:
            raise NoDataError(f"{self.part}: the newest message on {self.topic} is {age:.2f} s old", self.part)
        return newest[0]

    def latest(self) -> Value:
        """Return the newest value, however old, for callers that check its age. Raises NoDataError if there is none."""
        newest = self._newest
        if newest is None:
            raise NoDataError(f"{self.part}: no message on {self.topic} yet", self.part)
        return newest[0]

    @property
    def age(self) -> float:
        """Return the seconds since the newest value was stamped."""
        newest = self._newest
        return self._clock.now() - newest[1] if newest is not None else float("inf")

    @property
    def unlike_clock(self) -> str:
        """Return why the newest stamp contradicts a synchronised clock; empty if it does not, or if the clock is not
        declared synchronised.
        """
        if not isinstance(self._ros_time, SynchronisedTime):
            return ""
        if (ahead := self._ros_time.ahead) > FARTHEST_AHEAD:
            return f"is stamped {ahead:.2f} s later than its arrival"
        late = self._lateness.lag
        return f"is stamped {late:.2f} s before its arrival" if late > FARTHEST_BEHIND else ""

    def late(self, longest_delay: float) -> float | None:
        """Return the delay of recent messages if it exceeds ``longest_delay``, else None."""
        return self._lateness.late(longest_delay, self._clock.now())

    def newer_than(self, moment: float, deadline: float) -> tuple[Value, float] | None:
        """Wait until ``deadline`` (monotonic clock) for a value stamped after ``moment``; returns both, or None."""
        with self._arrived:
            while self._newest is None or self._newest[1] <= moment:
                left = deadline - time.monotonic()
                if left <= 0.0 or not self._arrived.wait(left):
                    return None
            return self._newest


TRANSPORT = "asyncio"
Handler = Callable[[Mapping[str, Any], float], None]
"""Receives a message and its arrival time; raises KeyError, TypeError or ValueError for a malformed message."""


class RosLink:
    """At most one connection at a time; messages arrive in roslibpy's thread, which all links of a process share."""

    def __init__(self, name: str, clock: Clock) -> None:
        self._name, self._clock = name, clock
        self._sdk: ModuleType | None = None
        self._ros: Any = None
        self._publishers: dict[str, Any] = {}
        self.heard = -1e9
        self.complaint = ""

    def open(
        self, load: Callable[[str], ModuleType], address: str, port: int, secure: bool, token: str, timeout: float
    ) -> None:
        """Connect. ``load`` imports the SDK; ``token``: for a proxy's Authorization header. Raises
        ConnectionFailedError.
        """
        self._sdk = load("roslibpy")
        for library in ("roslibpy", "autobahn"):  # they log addresses
            logging.getLogger(library).setLevel(logging.CRITICAL)
        # What was published while the wire was down is kept by roslibpy and would act when it is back.
        load("roslibpy.comm").select_factory(TRANSPORT).set_max_retries(0)
        headers = {"Authorization": f"Bearer {token}"} if token else None
        self.complaint = ""
        self._ros = self._sdk.Ros(address, port, is_secure=secure, headers=headers, transport=TRANSPORT)
        ready = threading.Event()
        self._ros.factory.on_ready(lambda protocol: ready.set())
        if not ready.wait(timeout):
            raise ConnectionFailedError(f"{self._name}: no rosbridge answers within {timeout:g} s")
        self._ros.factory.manager.loop.call_soon_threadsafe(take_real_time_priority)
        self.heard = self._clock.now()

    @property
    def connected(self) -> bool:
        """Return whether the websocket is known to be open."""
        return self._ros is not None and bool(self._ros.is_connected)

    def subscribe(self, topic: str, message_type: str, handler: Handler, period: float = 0.0) -> Callable[[], None]:
        """Call ``handler`` with each message, or with one per ``period`` seconds; returns a function that ends this."""
        assert self._sdk is not None

        def take(message: Mapping[str, Any]) -> None:
            self.heard = now = self._clock.now()
            try:
                handler(message, now)
            except (KeyError, TypeError, ValueError, IndexError) as error:
                self.complaint = f"a message on {topic} is malformed: {type(error).__name__}: {error}"

        subscription = self._sdk.Topic(
            self._ros, topic, message_type, throttle_rate=int(1000 * period), queue_length=1, reconnect_on_close=False
        )
        subscription.subscribe(take)
        end: Callable[[], None] = subscription.unsubscribe
        return end

    def advertise(self, topic: str, message_type: str) -> None:
        """Advertise a topic."""
        assert self._sdk is not None
        publisher = self._sdk.Topic(self._ros, topic, message_type, queue_size=1, reconnect_on_close=False)
        publisher.advertise()
        self._publishers[topic] = publisher

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """Publish a message; without a connection, nothing is sent, and the watchdog detects it."""
        publisher = self._publishers.get(topic)
        if publisher is not None and self.connected:
            publisher.publish(message)

    def close(self) -> None:
        """Close the websocket; idempotent."""
        ros, self._ros = self._ros, None
        self._publishers = {}
        if ros is None:
            return
        if ros.is_connected:
            with contextlib.suppress(TimeoutError):
                ros.close(timeout=1.0)
        else:  # it may still be connecting
            ros.factory.on_ready(lambda protocol: protocol.send_close())

    def abandon(self) -> None:
        """Drop the connection immediately, so that pending messages do not arrive."""
        ros = self._ros
        if ros is not None and ros.is_connected:
            ros.factory.on_ready(
                lambda protocol: ros.factory.manager.loop.call_soon_threadsafe(protocol.dropConnection, True)
            )
