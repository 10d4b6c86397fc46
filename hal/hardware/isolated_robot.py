"""A real robot whose connections run in a separate process, so that planning never delays its set-points."""

from __future__ import annotations

import math
import multiprocessing
import os
import subprocess
import sys
import threading
import time
import weakref
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from types import MappingProxyType
from typing import Any

from bestman_bt.robot_model.model import RobotModel
from bestman_bt.scene.scene import World
from hal.api import Camera, Failure, Motion, MotionErrorCode, MotionStatus, NotConnectedError, Part, Robot, RobotError
from hal.hardware.clock import RealTimeClock
from hal.hardware.controller_facts import ArmFacts, Identity
from hal.hardware.heartbeat import Heartbeat
from hal.hardware.robot import HardwareRobot
from hal.hardware.robot_process import ROBOT, STOPS, Call, MotionNumber, MotionReport, ServerSetup, plug_ins
from hal.parts.channels import ASIDES, interface_of, part_proxy
from hal.parts.part_connection import ConnectionFailedError
from hal.parts.streamed_arm import StreamedArm

END_TIME = 5.0
STOP_TIME = 0.5
"""Seconds for the other process to answer a stop, and to send a heartbeat after a silence."""
LOOK_PERIOD = 0.05
"""Seconds between checks that the other process is alive, while waiting for an answer."""
PROGRAM = "from hal.hardware.robot_process import main; main()"
PROCESS = "robot process"
"""The other process's name among faults."""


class IsolatedRobot(Robot):
    """A ``HardwareRobot`` that runs in a separate process from ``connect()`` to ``disconnect()``. Both processes
    exchange heartbeats. If this process dies or hangs, the other one brings the robot to rest. If the other process
    dies, motions fail as DISCONNECTED and its controllers get no more set-points; if it hangs, or does not answer a
    stop within ``STOP_TIME``, it is killed, with the same result. The robot then counts as stopped, with that fault;
    ``connect()`` and ``clear_stop()`` start another process.
    """

    clock: RealTimeClock  # the other process stamps readings by the same one

    def __init__(self, model: RobotModel, world: World | None = None, *, seed: int = 0, gui: bool = False) -> None:
        start = time.monotonic()
        self._start, self.clock = start, RealTimeClock(start)
        self._description = HardwareRobot(model, clock=self.clock)  # never connected: it describes, and refuses
        self._client = RpcClient(tuple(self._description.parts), self._description.stop)
        self.model = model
        self._black_box_in: Path | None = None
        self.parts = MappingProxyType(
            {name: _remote(part, self._client) for name, part in self._description.parts.items()}
        )

    @property
    def unsupported(self) -> dict[str, str]:
        """Return the missing functions of its controllers and the parts without a controller → the reason."""
        return self._description.unsupported

    def connect(self) -> None:
        """Start the other process and connect all controllers; raises the errors of ``HardwareRobot.connect``;
        idempotent.
        """
        if self._client.open:
            return
        lost = self._client.lost
        try:
            self._client.start(ServerSetup(self.model, self._start))
            for name, part in self._description.parts.items():
                if isinstance(part, StreamedArm) and part.load is not None:
                    self._client.call(Call(name, "carry", part.load))
            self._client.call(Call(ROBOT, "connect"))
            if self.speed != 1.0:
                self._client.call(Call(ROBOT, "set_speed", (self.speed,)))
            if self._black_box_in is not None:
                self._client.call(Call(ROBOT, "keep_black_box_in", (self._black_box_in,)))
            if self._description.stopped:
                self._client.stop(Call(ROBOT, "stop"))
            for name, part in self.parts.items():
                if isinstance(part, Camera):  # which tells its lens when it is connected
                    part.intrinsics = self._client.call(Call(name, "intrinsics"))
        except BaseException:
            self._client.close()
            self._client.lost = lost
            raise

    def disconnect(self) -> None:
        """Disconnect all controllers and end the other process; idempotent."""
        try:
            if self._client.open:
                if self.stopped:
                    self._description.stop()
                self._client.call(Call(ROBOT, "disconnect"))
        except NotConnectedError:
            pass  # it is gone already
        finally:
            self._client.close()
            self.clock.cancel_timers()

    def stop(self) -> None:
        """Bring all parts to rest and latch the stop; thread-safe, also during other calls.

        Takes at most ``STOP_TIME``: a process that does not answer by then is killed, see ``faults``.
        """
        self._description.stop()
        with suppress(NotConnectedError):  # it was lost: nothing moves any more
            self._client.stop(Call(ROBOT, "stop"))

    def keep_black_box_in(self, folder: Path | None) -> None:
        """Set the folder to which the other process writes the black box, even after this process has ended."""
        self._black_box_in = folder
        with suppress(NotConnectedError):
            if self._client.open:
                self._client.call(Call(ROBOT, "keep_black_box_in", (folder,)))

    def set_speed(self, share: float) -> None:
        """Set the speed like ``Robot.set_speed``, ahead of other requests and within the time of a stop."""
        super().set_speed(share)
        with suppress(NotConnectedError):  # the next process is told when it begins
            self._client.stop(Call(ROBOT, "set_speed", (self.speed,)))

    def clear_stop(self) -> None:
        """Accept commands again; reconnects if the process was lost. Raises the errors of
        ``HardwareRobot.clear_stop``.
        """
        stops = self._description.stops
        if self._client.lost is not None:
            self.connect()
        if self._client.open and self._description.stops == stops:
            self._client.call(Call(ROBOT, "clear_stop"))
        try:
            self._description.clear_stop(stops)
        except ConnectionFailedError:  # stopped meanwhile; what has cleared the other process may have come after it
            with suppress(NotConnectedError):
                self._client.stop(Call(ROBOT, "stop"))
            raise

    @property
    def stopped(self) -> bool:
        """Return whether the stop is latched."""
        return bool(self._asked("stopped", lambda: self._description.stopped))

    @property
    def stopped_at(self) -> float | None:
        """The clock time of the last stop of all parts in this connection, seconds."""
        answer = self._asked("stopped_at", lambda: self._description.stopped_at)
        return float(answer) if answer is not None else None

    @property
    def faults(self) -> Mapping[str, Failure]:
        """Controller → the fault that stopped the robot; also ``robot process`` if the process was lost."""
        lost = self._client.lost
        return dict(self._asked("faults", lambda: {PROCESS: lost} if lost is not None else {}))

    def diagnostics(self) -> dict[str, str]:
        """Return diagnostic texts by subject, without addresses."""
        texts: dict[str, str] = self._asked("diagnostics", self._description.diagnostics)
        lost = self._client.lost
        return texts if lost is None else {**texts, PROCESS: str(lost)}

    def identities(self) -> dict[str, Identity]:
        """Return the identities, like ``HardwareRobot``."""
        answer: dict[str, Identity] = self._client.call(Call(ROBOT, "identities"))
        return answer

    def arm_facts(self, arm: str) -> ArmFacts | None:
        """Return the arm facts, like ``HardwareRobot``."""
        answer: ArmFacts | None = self._client.call(Call(ROBOT, "arm_facts", (arm,)))
        return answer

    def _asked(self, what: str, otherwise: Callable[[], Any]) -> Any:
        """Query the other process; ``otherwise`` if there is none, or if it is lost during the query."""
        with suppress(NotConnectedError):
            if self._client.open:
                return self._client.call(Call(ROBOT, what))
        return otherwise()


class RpcClient:
    """The connections to the other process: one for stops and cancels, one for the robot, one for each part.

    A request to one part, such as an image, does not block other parts. ``lost``: why the process has ended without a
    disconnect; ``when_lost`` is then called immediately. Thread-safe.
    """

    def __init__(self, parts: tuple[str, ...], when_lost: Callable[[Failure], None]) -> None:
        self._names: tuple[str, ...] = (STOPS, ROBOT, *parts)
        self._when_lost = when_lost
        self._wires: Mapping[str, RpcConnection] = {}
        self._process: subprocess.Popen[bytes] | None = None
        self._heartbeat: Heartbeat | None = None
        self._losing = threading.Lock()
        self._counting = threading.Lock()
        self._motions: weakref.WeakSet[RemoteMotion] = weakref.WeakSet()
        self.lost: Failure | None = None

    @property
    def open(self) -> bool:
        """Return whether the other process is known to run."""
        return bool(self._wires) and self.lost is None

    def start(self, setup: ServerSetup) -> None:
        """Start the process; it is ready when this returns."""
        self.close()
        pairs = [
            multiprocessing.Pipe() for _ in self._names
        ]  # which block whatever a vendor's SDK makes of all sockets
        theirs = [their.fileno() for _, their in pairs]
        command = [sys.executable, "-c", PROGRAM, *map(str, theirs), *plug_ins(setup.model)]
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(
            command,
            pass_fds=theirs,
            env={**os.environ, "PYTHONPATH": path},
            stdin=subprocess.DEVNULL,
            start_new_session=True,  # a signal to the group of this process is for this process to handle
        )
        for _, their in pairs:
            their.close()
        self._wires = dict(zip(self._names, (RpcConnection(our) for our, _ in pairs), strict=True))
        self._heartbeat = Heartbeat(setup.model.safety.heartbeat)
        self._exchange(self._wires[ROBOT], replace(setup, heartbeat=self._heartbeat.address), math.inf)

    def close(self) -> None:
        """Close the connections, which ends the process; motions still running fail."""
        with self._losing:
            wires, self._wires = self._wires, {}
            process, self._process = self._process, None
            heartbeat, self._heartbeat = self._heartbeat, None
            if self.lost is not None and process is not None:
                process.kill()
            self.lost = None
        killer = threading.Timer(END_TIME, process.kill) if process is not None else None
        if killer is not None:  # closing a wire waits for what is being asked by it
            killer.daemon = True
            killer.start()
        for name in (ROBOT, *wires):  # the one after whose end it ends comes first
            if name in wires:
                wires[name].close()
        if process is not None and killer is not None:
            process.wait()
            killer.cancel()
        if heartbeat is not None:
            heartbeat.close()
        self._fail_motions("the robot was disconnected")

    def call(self, call: Call, part: str = "") -> Any:
        """Send a request and wait for the reply; exceptions of the other side are raised here. ``part``: part of the
        motion.
        """
        return self._ask(part or str(call.target), call)

    def stop(self, call: Call) -> Any:
        """Send a call with priority over other requests, for at most ``STOP_TIME``. Returns None without a process."""
        return self._ask(STOPS, call, STOP_TIME) if self.open else None

    def _ask(self, wire: str, call: Call, limit: float = math.inf) -> Any:
        if self.lost is not None:
            raise NotConnectedError(f"{call.target or 'the robot'} was used after {self.lost.text}; call connect()")
        found = self._wires.get(wire)
        if found is None:
            raise NotConnectedError(f"{call.target or 'the robot'} was used while it is not connected; call connect()")
        answer = self._exchange(found, call, limit)
        if isinstance(answer, Exception):
            raise answer
        if isinstance(answer, MotionNumber):
            motion = RemoteMotion(answer.number, str(call.target), self)
            with self._counting:
                self._motions.add(motion)
            return motion
        return answer

    def _exchange(self, wire: RpcConnection, question: Call | ServerSetup, limit: float) -> Any:
        try:
            asked = wire.ask(question)
            while True:
                try:
                    return asked.result(LOOK_PERIOD)
                except TimeoutError:
                    self._look(wire.waited > limit)
        except WireEndedError as error:
            self._lose("the process that holds the robot's connections has ended", wire)
            raise NotConnectedError(self.lost.text if self.lost is not None else str(error)) from error

    def _look(self, late: bool) -> None:
        """Kill the process where it hangs, which ends all questions. ``late``: it has not answered a stop in time."""
        heartbeat = self._heartbeat
        silent = heartbeat is not None and heartbeat.silence > STOP_TIME
        if late or silent:
            did_not = f"answer a stop within {STOP_TIME:g} s" if late else "give a sign of life"
            self._lose(f"the process that holds the robot's connections was killed because it did not {did_not}")

    def _lose(self, why: str, wire: RpcConnection | None = None) -> None:
        """Mark the process as gone. ``wire``: the connection that showed it, which may be a closed one."""
        with self._losing:
            if self.lost is not None or not self._wires or (wire is not None and wire not in self._wires.values()):
                return
            self.lost = Failure(MotionErrorCode.DISCONNECTED, why)
            if self._process is not None:
                self._process.kill()
        self._when_lost(self.lost)
        self._fail_motions(why)

    def _fail_motions(self, why: str) -> None:
        with self._counting:
            motions = tuple(self._motions)
        for motion in motions:
            motion.fail(MotionErrorCode.DISCONNECTED, why)


class WireEndedError(RobotError):
    """Raised if the other end of a connection is gone, or this end was closed."""


class RpcConnection:
    """A connection with one request at a time, handled in its own thread.

    If the waiting thread is interrupted, for example by Ctrl-C, the exchange is completed and its reply is discarded,
    so that requests and replies stay in step.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._sent = math.inf
        self._thread = ThreadPoolExecutor(1, "wire")
        # Begun here: an executor that is interrupted while it begins its thread forgets it and begins a second one.
        self._thread.submit(lambda: None).result()

    def ask(self, question: Any) -> Future[Any]:
        """Return the future reply. Raises WireEndedError if the other process is gone."""
        try:
            return self._thread.submit(self._exchange, question)
        except RuntimeError as error:  # closed meanwhile
            raise WireEndedError("the robot was disconnected") from error

    def _exchange(self, question: Any) -> Any:
        try:
            self._connection.send(question)
            self._sent = time.monotonic()
            return self._connection.recv()
        except (OSError, EOFError) as error:
            raise WireEndedError("the process that holds the robot's connections is gone") from error
        finally:
            self._sent = math.inf

    @property
    def waited(self) -> float:
        """Seconds since the pending request was sent; 0 if its reply has arrived, even if it has not been read yet."""
        try:
            return 0.0 if self._connection.poll() else max(0.0, time.monotonic() - self._sent)
        except (OSError, EOFError):
            return 0.0  # it has ended, which the question itself will say

    def close(self) -> None:
        """Close the connection after the current request."""
        self._thread.shutdown()
        self._connection.close()


class RemoteMotion(Motion[Any]):
    """A motion in the other process."""

    def __init__(self, number: int, part: str, client: RpcClient) -> None:
        super().__init__(part)
        self._number, self._client = number, client

    def cancel(self) -> None:
        """Stop the part."""
        if not self.done:
            self._take(lambda: self._client.stop(Call(self._number, "cancel")))

    def _look(self) -> None:
        self._take(lambda: self._client.call(Call(self._number, "poll"), self._part))

    def _take(self, ask: Callable[[], MotionReport | None]) -> None:
        try:
            report = ask()
        except NotConnectedError as error:
            self.end(MotionStatus.FAILED, error.failure)
            return
        if report is not None and report.status is not MotionStatus.RUNNING:
            self.end(report.status, report.failure, report.result)


def _remote(part: Part, client: RpcClient) -> Part:
    """Return a part of the same kind that asks the other process; its description, and its refusals, are those of
    ``part``.
    """
    interface = interface_of(type(part))
    methods = ("stop", *interface.readings, *interface.commands, *interface.asides)
    return part_proxy("Remote", interface, part.name, {name: _asking(part, name, client) for name in methods}, part)


def _asking(part: Part, method: str, client: RpcClient) -> Any:
    def ask(self: Part, *arguments: Any, **keywords: Any) -> Any:
        if method in ASIDES:
            getattr(part, method)(*arguments, **keywords)  # which keeps it for the next process
        if not client.open and client.lost is None:
            return getattr(part, method)(*arguments, **keywords)  # which is not connected, and says so
        call = Call(part.name, method, arguments, tuple(keywords.items()))
        return client.stop(call) if method == "stop" else client.call(call)

    return ask
