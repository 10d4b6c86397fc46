"""A real robot whose connections live in a process of their own, so that planning never holds up its set-points."""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
import weakref
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from types import MappingProxyType
from typing import Any

from bestman_bt.robot_model import RobotModel
from bestman_bt.scene import World
from hal.api import Failure, Motion, MotionErrorCode, MotionStatus, NotConnectedError, Part, Robot
from hal.hardware.clock import RealTimeClock
from hal.hardware.robot import HardwareRobot
from hal.hardware.robot_process import ROBOT, Call, MotionNumber, Setup, plug_ins
from hal.parts import interface_of

END_TIME = 5.0
PROGRAM = "from hal.hardware.robot_process import main; main()"


class IsolatedRobot(Robot):
    """As ``HardwareRobot``, which runs in a process of its own from ``connect()`` to ``disconnect()``.

    Should this process die, the other one notices, brings the robot to rest and ends. Should that one die, motions
    fail as DISCONNECTED and its controllers get no more set-points.
    """

    clock: RealTimeClock  # the other process stamps readings by the same one

    def __init__(self, model: RobotModel, world: World | None = None, *, seed: int = 0, gui: bool = False) -> None:
        start = time.monotonic()
        self._start, self.clock = start, RealTimeClock(start)
        self._description = HardwareRobot(model, clock=self.clock)  # never connected: it describes, and refuses
        self._client = RpcClient()
        self.model = model
        self.parts = MappingProxyType(
            {name: _remote(part, self._client) for name, part in self._description.parts.items()}
        )

    @property
    def unsupported(self) -> dict[str, str]:
        """What its controllers cannot do, and the parts of the model that are behind none of them → why."""
        return self._description.unsupported

    def connect(self) -> None:
        """Start the other process and connect all controllers; raises as ``HardwareRobot.connect``; idempotent."""
        if self._client.open:
            return
        self._client.start(Setup(self.model, self._start))
        try:
            self._client.call(Call(ROBOT, "connect"))
            if self._description.stopped:
                self._client.stop(Call(ROBOT, "stop"))
        except BaseException:
            self._client.close()
            raise

    def disconnect(self) -> None:
        """Disconnect all controllers and end the other process; idempotent."""
        if not self._client.open:
            return
        try:
            if self.stopped:
                self._description.stop()
            self._client.call(Call(ROBOT, "disconnect"))
        except NotConnectedError:
            pass  # it is gone already
        finally:
            self._client.close()
            self.clock.cancel_timers()

    def stop(self) -> None:
        """Bring all parts to rest and latch; safe from any thread, whatever else is being asked."""
        self._description.stop()
        if self._client.open:
            self._client.stop(Call(ROBOT, "stop"))

    def clear_stop(self) -> None:
        """Accept commands again; raises as ``HardwareRobot.clear_stop``."""
        if self._client.open:
            self._client.call(Call(ROBOT, "clear_stop"))
        self._description.clear_stop()

    @property
    def stopped(self) -> bool:
        """Whether the stop is latched."""
        return bool(self._client.call(Call(ROBOT, "stopped"))) if self._client.open else self._description.stopped

    @property
    def stopped_at(self) -> float | None:
        """When all parts were last told to stop, seconds of the clock; of this connection."""
        answer = self._client.call(Call(ROBOT, "stopped_at")) if self._client.open else self._description.stopped_at
        return float(answer) if answer is not None else None

    @property
    def faults(self) -> Mapping[str, Failure]:
        """Controller → the fault that stopped the robot."""
        return dict(self._client.call(Call(ROBOT, "noted_faults"))) if self._client.open else {}

    def diagnostics(self) -> dict[str, str]:
        """Short texts by subject; no addresses."""
        texts: dict[str, str] = (
            self._client.call(Call(ROBOT, "diagnostics")) if self._client.open else self._description.diagnostics()
        )
        return texts


class RpcClient:
    """Both wires to the other process, and the motions that go on there."""

    def __init__(self) -> None:
        self._calls: RpcConnection | None = None
        self._stops: RpcConnection | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._motions: weakref.WeakSet[RemoteMotion] = weakref.WeakSet()

    @property
    def open(self) -> bool:
        """Whether there is another process, as far as is known."""
        return self._calls is not None

    def start(self, setup: Setup) -> None:
        """Start the process; it is ready when this returns."""
        pairs = [multiprocessing.Pipe() for _ in range(2)]  # which block whatever a vendor's SDK makes of all sockets
        theirs = [their.fileno() for _, their in pairs]
        command = [sys.executable, "-c", PROGRAM, *map(str, theirs), *plug_ins(setup.model)]
        path = os.pathsep.join(filter(None, sys.path))
        self._process = subprocess.Popen(
            command, pass_fds=theirs, env={**os.environ, "PYTHONPATH": path}, stdin=subprocess.DEVNULL
        )
        for _, their in pairs:
            their.close()
        self._calls, self._stops = (RpcConnection(our) for our, _ in pairs)
        self._calls.ask(setup)

    def close(self) -> None:
        """End the process: it ends with its wires; what still moved has failed."""
        for wire in (self._calls, self._stops):
            if wire is not None:
                wire.close()
        self._calls = self._stops = None
        if self._process is not None:
            try:
                self._process.wait(END_TIME)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
            self._process = None
        for motion in tuple(self._motions):
            motion.fail(MotionErrorCode.DISCONNECTED, "the robot was disconnected")

    def call(self, call: Call) -> Any:
        """Ask, and wait for the answer; what the other side raised is raised here."""
        return self._ask(self._calls, call)

    def stop(self, call: Call) -> Any:
        """As ``call``, past whatever else is being asked."""
        return self._ask(self._stops, call)

    def _ask(self, wire: RpcConnection | None, call: Call) -> Any:
        if wire is None:
            raise NotConnectedError(f"{call.target or 'the robot'} was used while it is not connected; call connect()")
        answer = wire.ask(call)
        if isinstance(answer, MotionNumber):
            motion = RemoteMotion(answer.number, str(call.target), self)
            self._motions.add(motion)
            return motion
        return answer


class RpcConnection:
    """One question at a time, asked by a thread of its own.

    An interrupt of the thread that waits, as Ctrl-C is of the main thread, leaves no question half asked and no answer
    for the next question: the exchange ends all the same, and its answer is dropped.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._thread = ThreadPoolExecutor(1, "wire")
        # Begun here: an executor that is interrupted while it begins its thread forgets it and begins a second one.
        self._thread.submit(lambda: None).result()

    def ask(self, question: Any) -> Any:
        """The answer; NotConnectedError where the other process is gone."""
        try:
            asked = self._thread.submit(self._exchange, question)
        except RuntimeError as error:  # closed meanwhile
            raise NotConnectedError("the robot was disconnected") from error
        answer = asked.result()
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _exchange(self, question: Any) -> Any:
        try:
            self._connection.send(question)
            return self._connection.recv()
        except (OSError, EOFError) as error:
            raise NotConnectedError("the process that holds the robot's connections is gone") from error

    def close(self) -> None:
        """End it, after the question that is being asked."""
        self._thread.shutdown()
        self._connection.close()


class RemoteMotion(Motion[Any]):
    """A motion in the other process."""

    def __init__(self, number: int, part: str, client: RpcClient) -> None:
        super().__init__(part)
        self._number, self._client = number, client

    def cancel(self) -> None:
        """Bring the part to rest."""
        if not self.done:
            self._ask("cancel")

    def _look(self) -> None:
        self._ask("poll")

    def _ask(self, method: str) -> None:
        try:
            report = self._client.call(Call(self._number, method))
        except NotConnectedError as error:
            self.end(MotionStatus.FAILED, error.failure)
            return
        if report.status is not MotionStatus.RUNNING:
            self.end(report.status, report.failure, report.result)


def _remote(part: Part, client: RpcClient) -> Part:
    """A part of the same kind that asks the other process; its description, and its refusals, are those of ``part``."""
    interface = interface_of(type(part))
    methods = ("stop", *interface.readings, *interface.commands)
    members = {name: _asking(part, name, client) for name in methods}
    remote: Part = type(f"Remote{interface.kind.__name__}", (interface.kind,), members)(part.name)
    for name in ("model", *interface.attributes):
        if hasattr(part, name):  # sensors have no model of their own
            setattr(remote, name, getattr(part, name))
    return remote


def _asking(part: Part, method: str, client: RpcClient) -> Any:
    def ask(self: Part, *arguments: Any, **keywords: Any) -> Any:
        if not client.open:
            return getattr(part, method)(*arguments, **keywords)  # which is not connected, and says so
        call = Call(part.name, method, arguments, tuple(keywords.items()))
        return client.stop(call) if method == "stop" else client.call(call)

    return ask
