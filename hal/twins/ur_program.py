"""Emulates the program that ur-rtde uploads: a loop that reads commands from RTDE registers.

What a command does and how it is acknowledged is that of ``scripts/rtde_control.script`` in ur-rtde 1.6.5: register 0
is 1 when ready and 2 when a command is done, which the client answers by clearing it; real-time commands need no
answer. Also from there:

- ``thread speed_thread(): while (True): … speedj(target, a=acceleration, t=time)``: a speed lasts until command 15,
  and a new one is read when the current ``speedj`` has lasted its ``time``.
- ``thread servo_thread(): while (True): … servoj(…)``: likewise, until command 16.
- ``stopj(deceleration_rate)``, ``stopl(…)``: the command is done when the arm rests.

A client's own program that uses these registers may set the watchdog immediately, and run its path on
command 1.

Motion functions of two threads at once are a run-time error that ends the program ("another thread is already
controlling the robot", URScript manual, Threads).
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hal.api import Arm, Motion
from hal.twins.servo_follower import ServoFollower
from hal.twins.ur_kinematics import URKinematics

Array = NDArray[np.float64]
READY, DONE = 1, 2
RUNNING_BIT = 1 << 15
LIMIT_MARGIN = 1e-3
AT_REST = 0.02
"""rad/s below which ``stopj`` returns."""


class Command(IntEnum):
    """The commands that have an effect in the twin; all others are acknowledged and ignored."""

    NONE = 0
    MOVE_JOINTS = 1
    SPEED_JOINTS = 9
    SPEED_TOOL = 10
    SERVO_JOINTS = 11
    SPEED_STOP = 15
    SERVO_STOP = 16
    PROTECTIVE_STOP = 31
    STOP_TOOL = 33
    STOP_JOINTS = 34
    GET_TCP_OFFSET = 40
    SET_PAYLOAD = 17
    SET_WATCHDOG = 35
    MOVE_PATH = 45
    STOP_PROGRAM = 255


REAL_TIME = frozenset({6, 9, 10, 11, 24, 25, 26, 27, 38, 55, 58})


@dataclass(frozen=True, eq=False)
class Waypoint:
    """One ``movej`` of a path: positions (6,) rad, acceleration rad/s², speed rad/s."""

    positions: Array
    acceleration: float
    speed: float


@dataclass(frozen=True, eq=False)
class Speed:
    """A speed command. ``joints``: current joint speeds, (6,) rad/s. ``time``: seconds that one ``speedj`` or
    ``speedl`` lasts.
    """

    joints: Callable[[], Array]
    time: float


_PATH = re.compile(r"# inject move path\n((?:\s*(?:signal_async_progress|movej)\(.*\)\n)+)")
_WATCHDOG = re.compile(r'^  rtde_set_watchdog\("input_int_register_0", ([\d.]+), "stop"\)$', re.MULTILINE)
_PATH_ON_COMMAND_1 = re.compile(r"cmd == 1:\n\s*tell_asynchronous\(True\)\n")
_MOVE = re.compile(r"movej\(\[([^\]]*)\],\s*a=([^,]+),\s*v=([^,]+),")


def path_of(script: str) -> list[Waypoint]:
    """Return the waypoints that ``moveJ(path)`` has written into the script."""
    injected = _PATH.search(script)
    moves = _MOVE.findall(injected.group(1)) if injected else []
    return [Waypoint(np.array([float(q) for q in joints.split(",")]), float(a), float(v)) for joints, a, v in moves]


def _command(inputs: Mapping[str, Any]) -> tuple[int, list[float]]:
    return int(inputs.get("input_int_register_0", 0)), [
        float(inputs.get(f"input_double_register_{index}", 0.0)) for index in range(8)
    ]


class URProgram:
    """One run of the program on an arm; used in the world's thread."""

    def __init__(self, script: str, arm: Arm, kinematics: URKinematics) -> None:
        self._arm, self._kinematics, self._path = arm, kinematics, path_of(script)
        self._speed = arm.model.velocity
        self._lower = arm.model.lower
        self._upper = arm.model.upper
        self._executing = self._acknowledged = False
        self._moves: list[Waypoint] = []
        self._move: Waypoint | None = None
        self._slider = 1.0
        self.payload: float | None = None  # kg, where this program has set it
        self._motion: Motion[None] | None = None
        self._asynchronous = False
        self._drift: Speed | None = None  # under way, for so many seconds
        self._drift_left = 0.0
        self._next_drift: Speed | None = None
        self._stopping = False
        self.follower: ServoFollower | None = None
        set_at_once = _WATCHDOG.search(script)  # not on command 35
        self.watchdog_frequency = float(set_at_once.group(1)) if set_at_once else None
        self._path_on_command_1 = _PATH_ON_COMMAND_1.search(script) is not None
        self.ended = self.protective_stop_asked = self.limit_exceeded = False
        self.outputs: dict[str, float] = {"output_int_register_0": READY, "output_int_register_2": 0}

    def halt(self) -> None:
        """Brake to rest and end the program."""
        self._arm.stop()
        self.follower, self._motion, self._drift, self._next_drift = None, None, None, None
        self._moves = []
        self._report_running(False)

    def pause(self) -> None:
        """Hold the arm at its current position."""
        if self.follower is None:
            self._arm.stop()
        else:
            self.follower.rest()
        if self._motion is not None and self._move is not None:
            self._moves.insert(0, self._move)

    def resume(self) -> None:
        """Continue the interrupted motion."""
        if self._motion is not None:
            self._next_move()

    def advance(
        self, dt: float, inputs: Mapping[str, Any], arrived: Sequence[Mapping[str, Any]], slider: float = 1.0
    ) -> None:
        """Execute one cycle.

        ``inputs``: the registers. ``arrived``: their contents after each command since the last cycle; several if this
        process was delayed. ``slider``: speed slider of the pendant, 0 to 1.
        """
        self._slider = slider
        command, numbers = _command(inputs)
        if command in REAL_TIME:
            if arrived:
                self._stream(command, numbers, arrived)
            self.outputs["output_int_register_0"] = READY
        elif command == Command.NONE:
            self._executing = self._acknowledged = False
            self.outputs["output_int_register_0"] = READY
        elif not self._executing:
            self._executing = True
            self._begin(command, numbers, bool(inputs.get("input_int_register_1", 0)))
        self._go_on(dt)
        if self._stopping and float(np.max(np.abs(self._arm.velocities()))) < AT_REST:
            self._stopping = False
            self._report_running(False)
        waits = (self._motion is not None or self._stopping) and not self._asynchronous
        if self._executing and not self._acknowledged and not waits and not self.ended:
            self._acknowledged = True
            self.outputs["output_int_register_0"] = DONE

    def _stream(self, command: int, numbers: list[float], arrived: Sequence[Mapping[str, Any]]) -> None:
        if command == Command.SERVO_JOINTS:
            if self._next_drift is not None or self._motion is not None:
                self.ended = True
            elif self.follower is None:
                self.halt()
                self.follower = ServoFollower(self._arm.positions(), self._speed)
            goals = [np.array(registers[:6]) for each, registers in map(_command, arrived) if each == command]
            if self.follower is not None and all(map(self._reachable, goals)):
                self.follower.take(time.monotonic(), *(np.clip(goal, self._lower, self._upper) for goal in goals))
        elif command in (Command.SPEED_JOINTS, Command.SPEED_TOOL):
            target = np.array(numbers[:6])
            if self.follower is not None or self._motion is not None:
                self.ended = True
            elif command == Command.SPEED_TOOL:
                kinematics, arm = self._kinematics, self._arm
                self._next_drift = Speed(lambda: kinematics.joint_speeds(arm.positions(), target), numbers[7])
            else:
                self._next_drift = Speed(lambda: target, numbers[7])

    def _begin(self, command: int, numbers: list[float], asynchronous: bool) -> None:
        self._asynchronous = asynchronous
        if command in (Command.MOVE_JOINTS, Command.MOVE_PATH):
            if self.follower is not None or self._next_drift is not None:
                self.ended = True
                return
            self.halt()
            single = [Waypoint(np.array(numbers[:6]), numbers[7], numbers[6])]
            alone = command == Command.MOVE_JOINTS and not self._path_on_command_1
            self._moves = single if alone else list(self._path)
            self._next_move()
        elif command in (Command.SPEED_STOP, Command.SERVO_STOP, Command.STOP_JOINTS, Command.STOP_TOOL):
            self.halt()
            self._stopping = True
            if asynchronous:
                self._report_running(True)
        elif command == Command.SET_WATCHDOG:
            self.watchdog_frequency = numbers[0]
        elif command == Command.SET_PAYLOAD:
            self.payload = numbers[0]
        elif command == Command.GET_TCP_OFFSET:  # there is no tool: the flange is the tool
            self.outputs |= {f"output_double_register_{index}": 0.0 for index in range(6)}
        elif command == Command.PROTECTIVE_STOP:
            self.protective_stop_asked = True
        elif command == Command.STOP_PROGRAM:
            self.halt()
            self.ended = True

    def _report_running(self, running: bool) -> None:
        self.outputs["output_int_register_2"] = RUNNING_BIT if running else 0

    def _next_move(self) -> None:
        if not self._moves:
            self._motion = None
            self._report_running(False)
            return
        move = self._move = self._moves.pop(0)
        if not self._reachable(move.positions):
            return
        share = float(np.clip(self._slider * move.speed / float(np.max(self._speed)), 0.01, 1.0))
        self._motion = self._arm.move_to(np.clip(move.positions, self._lower, self._upper), share)
        self._report_running(True)

    def _reachable(self, positions: Array) -> bool:
        """Return whether the joints' limits allow these positions; else the safety system is to stop the robot."""
        within = (positions > self._lower - LIMIT_MARGIN) & (positions < self._upper + LIMIT_MARGIN)
        self.limit_exceeded = self.limit_exceeded or not bool(np.all(within))
        return not self.limit_exceeded

    def _go_on(self, dt: float) -> None:
        if self.follower is not None:
            self._arm.servo(self.follower.advance(dt * self._slider))
        elif self._motion is not None and self._motion.done:
            self._next_move()
        elif self._next_drift is not None:
            self._drift_left -= dt
            if self._drift is None or self._drift_left <= 0.0:
                self._drift, self._drift_left = self._next_drift, self._next_drift.time
            self._arm.command(velocities=np.clip(self._slider * self._drift.joints(), -self._speed, self._speed))
