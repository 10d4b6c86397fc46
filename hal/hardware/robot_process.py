"""The process that owns a robot's connections, separate from the planning process, whose computations would delay it.

Started by ``IsolatedRobot`` with the descriptors of its sockets: the first for stops and cancels, which wait for
nothing; the second for calls to the whole robot; one per part for its commands and readings.
"""

from __future__ import annotations

import importlib.util
import itertools
import os
import signal
import sys
import threading
from collections import OrderedDict
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from bestman_bt.registry import CONNECTIONS
from bestman_bt.robot_model.model import RobotModel
from hal.api import Failure, Motion, MotionStatus, RobotError
from hal.hardware.clock import RealTimeClock
from hal.hardware.control_loop import take_real_time_priority
from hal.hardware.heartbeat import Heartbeat
from hal.hardware.robot import HardwareRobot

ROBOT = ""
"""The name of the robot itself among its parts."""
STOPS = "/stops"
"""The name of the connection for stops."""
OURS = ("bestman_bt", "hal")
"""Packages that each process has."""
REMEMBERED_MOTIONS = 200
REST_TIME = 0.6
SERVING_PRIORITY = 2
"""Real-time priority, below that of the control loops: these wait while another thread holds the interpreter's lock, so
no such thread may be preempted on a busy machine.
"""


@dataclass(frozen=True)
class ServerSetup:
    """The first message to the process. ``clock_start``: start time on the monotonic clock, which all processes share,
    seconds. ``heartbeat``: address for the mutual heartbeats; empty: none are exchanged.
    """

    model: RobotModel
    clock_start: float
    heartbeat: str = ""


@dataclass(frozen=True)
class Call:
    """A call of ``method`` of a part, of the robot, or (``poll``, ``cancel``) of the motion with that number."""

    target: str | int
    method: str
    arguments: tuple[Any, ...] = ()
    keywords: tuple[tuple[str, Any], ...] = ()


@dataclass(frozen=True)
class MotionNumber:
    """The number of a motion that runs in the other process."""

    number: int


@dataclass(frozen=True)
class MotionReport:
    """The state of a motion."""

    status: MotionStatus
    failure: Failure | None
    result: Any = None


class RobotServer:
    """Executes the calls for one robot."""

    def __init__(self, setup: ServerSetup) -> None:
        self._heartbeat = Heartbeat(setup.model.safety.heartbeat, setup.heartbeat) if setup.heartbeat else None
        self._robot = HardwareRobot(setup.model, clock=RealTimeClock(setup.clock_start), planner=self._heartbeat)
        self._motions: OrderedDict[int, Motion[Any]] = OrderedDict()
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()

    def serve(self, wire: Connection) -> None:
        """Answer calls until the connection closes."""
        while True:
            try:
                call = wire.recv()
            except (EOFError, OSError):
                return
            try:
                answer = self._do(call)
            except Exception as error:  # noqa: BLE001 - it belongs to the one who asked
                answer = error if isinstance(error, (RobotError, ValueError)) else RuntimeError(repr(error))
            wire.send(answer)

    def close(self) -> None:
        """Bring the robot to rest, then disconnect it, unless the planning program has already done so."""
        with ExitStack() as rest:
            if self._heartbeat is not None:
                rest.callback(self._heartbeat.close)
            if self._robot.connected:
                rest.callback(self._robot.disconnect)
                rest.callback(threading.Event().wait, REST_TIME)
                self._robot.stop()

    def _do(self, call: Call) -> Any:
        if isinstance(call.target, int):
            return self._of_motion(call.target, call.method)
        subject = self._robot if call.target == ROBOT else self._robot.parts[call.target]
        found = getattr(subject, call.method)
        answer = found(*call.arguments, **dict(call.keywords)) if callable(found) else found
        return self._numbered(answer) if isinstance(answer, Motion) else answer

    def _of_motion(self, number: int, method: str) -> MotionReport:
        motion = self._motions[number]
        if method == "cancel":
            motion.cancel()
        return MotionReport(motion.status, motion.failure, motion.result)

    def _numbered(self, motion: Motion[Any]) -> MotionNumber:
        with self._lock:
            number = next(self._numbers)
            self._motions[number] = motion
            while len(self._motions) > REMEMBERED_MOTIONS:
                self._motions.popitem(last=False)
        return MotionNumber(number)


def plug_ins(model: RobotModel) -> list[str]:
    """Return ``module=file`` of the users' Python files that provide a kind of part or a driver of this robot."""
    classes = [type(part) for part in model.parts.values()]
    classes += [CONNECTIONS.resolve(settings.driver) for settings in model.connections.values()]
    own = dict.fromkeys(cls.__module__ for cls in classes if cls.__module__.partition(".")[0] not in OURS)
    return [f"{name}={sys.modules[name].__file__}" for name in own]


def _load(name: str, file: str) -> None:
    """Run a user's file under the name that it has in the process that plans; it may import modules beside it."""
    specification = importlib.util.spec_from_file_location(name, file)
    if specification is None or specification.loader is None:
        raise ImportError(f"{file} should be a Python file (.py)")
    sys.path.insert(0, str(Path(file).parent))
    sys.modules[name] = module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)


def main() -> None:
    """Serve all connections until that for the whole robot ends."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # they are for the program that plans; it ends the wires
    numbers = [word for word in sys.argv[1:] if word.isdigit()]
    stops, calls, *parts = (Connection(int(descriptor)) for descriptor in numbers)
    for plug_in in sys.argv[1 + len(numbers) :]:
        _load(*plug_in.split("=", 1))
    take_real_time_priority(SERVING_PRIORITY)  # and all threads from here on
    os.dup2(2, 1)  # what SDKs print is no output of the program
    server = RobotServer(calls.recv())
    for wire in (stops, *parts):
        threading.Thread(target=server.serve, args=(wire,), name="wire", daemon=True).start()
    calls.send(None)
    server.serve(calls)
    server.close()
