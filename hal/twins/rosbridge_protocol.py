"""The rosbridge protocol, version 2.0, of a server:
https://github.com/RobotWebTools/rosbridge_suite/blob/ros2/ROSBRIDGE_PROTOCOL.md.
"""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from bestman_bt.extras import install_command
from hal.twins.errors import TwinError
from hal.twins.faults import Faults
from hal.twins.ros_messages import Message

try:
    from websockets.exceptions import ConnectionClosed
    from websockets.http11 import Request
    from websockets.sync.server import ServerConnection, serve
except ImportError as error:
    raise TwinError(
        f"the twin of a rosbridge needs the package 'websockets': {install_command('rosbridge')}"
    ) from error

LONGEST_OUTBOX = 200
POLL = 0.02
Taker = Callable[[Mapping[str, Any]], None]
"""Handles a message published by a client; raises KeyError, TypeError or ValueError if it is malformed."""


@dataclass
class Subscription:
    """A client's subscription to a topic: minimum seconds between messages, and the time of the last one."""

    topic: str
    period: float
    last: float = -1e9


class Client:
    """One connection: its subscriptions, and its outgoing queue."""

    def __init__(self, wire: ServerConnection, faults: Faults) -> None:
        self._wire, self._faults = wire, faults
        self.subscriptions: dict[str, Subscription] = {}  # by id
        self._outbox: deque[tuple[float, str]] = deque(maxlen=LONGEST_OUTBOX)
        self._filled = threading.Condition()
        self._gone = False

    def wants(self, topic: str) -> bool:
        """Return whether a message of the topic is due to it."""
        now, due = time.monotonic(), False
        for subscription in tuple(self.subscriptions.values()):
            if subscription.topic == topic and now - subscription.last >= subscription.period:
                subscription.last, due = now, True
        return due

    def put(self, document: str) -> None:
        """Send after the wire's delay; messages on a silent wire are lost."""
        wire = self._faults.wire
        if not wire.silent:
            with self._filled:
                self._outbox.append((time.monotonic() + wire.delay, document))
                self._filled.notify()

    def send_all(self) -> None:
        """Send the queued messages, until ``leave``."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                with self._filled:
                    while not self._outbox and not self._gone:
                        self._filled.wait()
                    if self._gone:
                        return
                    due, document = self._outbox.popleft()
                time.sleep(max(0.0, due - time.monotonic()))
                self._wire.send(document)

    def disconnect(self) -> None:
        """Close the connection without the closing handshake, like a terminated server."""
        with contextlib.suppress(OSError):
            self._wire.socket.shutdown(socket.SHUT_RDWR)

    def leave(self) -> None:
        """End ``send_all``."""
        with self._filled:
            self._gone = True
            self._filled.notify()


class RosbridgeServer:
    """Topics between one robot and any number of clients. Raises OSError if the port is not available.

    ``types``: topic → message type, of all topics. ``takers``: topic → handler of its messages.
    """

    def __init__(
        self,
        address: str,
        port: int,
        types: Mapping[str, str],
        takers: Mapping[str, Taker],
        now: Callable[[], Message],
        faults: Faults,
    ) -> None:
        self._types, self._takers, self._now, self._faults = types, takers, now, faults
        self._clients: set[Client] = set()
        self._server = serve(
            self._attend,
            address,
            port,
            compression=None,
            process_request=self._wait_for_wire,
            open_timeout=None,
            ping_interval=None,
            max_size=None,
        )
        self.subscribed = threading.Event()
        self._services: dict[str, Callable[[Mapping[str, Any]], Message]] = {
            "/rosapi/topics": lambda asked: {"topics": list(types), "types": list(types.values())},
            "/rosapi/topic_type": lambda asked: {"type": types.get(str(asked["topic"]), "")},
            "/rosapi/get_time": lambda asked: {"time": now()},
        }

    def start(self) -> None:
        """Accept clients."""
        threading.Thread(target=self._server.serve_forever, name="rosbridge", daemon=True).start()

    def close(self) -> None:
        """Close the port and all clients."""
        self._server.socket.close()  # its shutdown() would wait for clients that are stuck
        self.close_clients()

    def close_clients(self) -> None:
        """Close all connections, as a restarting server does."""
        for client in tuple(self._clients):
            client.disconnect()

    def has_subscriber(self, topic: str) -> bool:
        """Return whether a topic has subscribers."""
        return any(s.topic == topic for client in tuple(self._clients) for s in tuple(client.subscriptions.values()))

    def publish(self, topic: str, message: Callable[[], Message]) -> None:
        """Send a message to the subscribers; it is built only if there are any."""
        if takers := [client for client in tuple(self._clients) if client.wants(topic)]:
            document = json.dumps({"op": "publish", "topic": topic, "msg": message()})
            for client in takers:
                client.put(document)

    def _attend(self, connection: ServerConnection) -> None:
        client = Client(connection, self._faults)
        inbox: queue.SimpleQueue[tuple[float, str | bytes] | None] = queue.SimpleQueue()
        threading.Thread(target=client.send_all, name="rosbridge sender", daemon=True).start()
        threading.Thread(target=self._answer_all, args=(client, inbox), name="rosbridge receiver", daemon=True).start()
        self._clients.add(client)
        try:
            with contextlib.suppress(ConnectionClosed):
                for text in connection:
                    if not self._faults.wire.silent:
                        inbox.put((time.monotonic() + self._faults.wire.delay, text))
        finally:
            self._clients.discard(client)
            client.leave()
            inbox.put(None)

    def _answer_all(self, client: Client, inbox: queue.SimpleQueue[tuple[float, str | bytes] | None]) -> None:
        """Answer each message when it is due: a delay of the wire holds each one back, the rate stays."""
        while (arrived := inbox.get()) is not None:
            due, text = arrived
            time.sleep(max(0.0, due - time.monotonic()))
            self._answer(client, text)

    def _wait_for_wire(self, connection: ServerConnection, request: Request) -> None:
        while self._faults.wire.silent:
            time.sleep(POLL)

    def _answer(self, client: Client, text: str | bytes) -> None:
        try:
            asked = json.loads(text)
            operation = asked["op"]
            match operation:
                case "advertise" | "subscribe":
                    self._check_type(asked)
                    if operation == "subscribe":
                        self._subscribe(client, asked)
                case "unsubscribe":
                    for number, held in tuple(client.subscriptions.items()):
                        if held.topic == asked["topic"] and asked.get("id") in (None, number):
                            del client.subscriptions[number]
                case "publish":
                    if asked["topic"] in self._takers:
                        self._takers[asked["topic"]](asked["msg"])
                case "call_service":
                    self._call(client, asked)
                case "unadvertise" | "set_level":
                    pass
                case _:
                    raise ValueError(f"unknown operation {operation}")
        except (KeyError, TypeError, ValueError) as error:
            status = {"op": "status", "level": "error", "msg": f"{type(error).__name__}: {error}"}
            client.put(json.dumps(status))

    def _check_type(self, asked: Mapping[str, Any]) -> None:
        """Check that a topic has one type; both versions of ROS accept types without ``msg``."""
        requested, known = asked.get("type"), self._types.get(asked["topic"])
        if requested and known and requested.replace("/msg/", "/") != known.replace("/msg/", "/"):
            raise ValueError(f"{asked['topic']} is of type {known}, not {requested}")

    def _subscribe(self, client: Client, asked: Mapping[str, Any]) -> None:
        if asked.get("compression", "none") != "none":
            raise ValueError(f"compression {asked['compression']} is not offered")
        number = str(asked.get("id", asked["topic"]))
        client.subscriptions[number] = Subscription(asked["topic"], 0.001 * float(asked.get("throttle_rate", 0)))
        self.subscribed.set()

    def _call(self, client: Client, asked: Mapping[str, Any]) -> None:
        service = self._services.get(asked["service"])
        answer: Message = {"op": "service_response", "id": asked.get("id"), "service": asked["service"]}
        if service is None:
            answer |= {"result": False, "values": f"service {asked['service']} does not exist"}
        else:
            answer |= {"result": True, "values": service(asked.get("args") or {})}
        client.put(json.dumps(answer))
