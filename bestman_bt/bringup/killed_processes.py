"""Kills the processes that command the moving robot: it must stop and stay in place."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bestman_bt.bringup.brought_up_robot import SPEED, BroughtUpRobot, for_each_part
from bestman_bt.bringup.finding import CheckFinding, judged, not_applicable
from bestman_bt.bringup.mover import CREEP, SWING_SPEED
from hal.api import JointGroup, MobileBase, RobotError

PROCESSES = ("planner", "robot process", "SDK process")
"""Each process is the parent of the next; the third exists for controllers whose SDK needs one."""
PROGRAM = "from bestman_bt.bringup.mover import main; main()"
SET_OUT = 0.03
"""Distance that the part has moved before a process is killed, radians or metres."""
START_TIME, ALONE = 60.0, 2.0
"""Seconds for the moving program to start, and for which the robot is then only observed."""
REST_TIME = 0.5
SPARE, STILL, WATCHED = 0.03, 0.003, 0.5
"""Tolerance in addition to the motion within ``REST_TIME``, radians; largest drift within ``WATCHED`` seconds."""
DEAD_MAN = 1.0
"""Seconds within which a base has to be at rest without commands; ROS bases take 0.5."""
BASE_SPARE = 0.02


class Mover:
    """The program ``mover`` in a separate process. ``at``: the last position of the part that it reported."""

    def __init__(self, subject: BroughtUpRobot, part: str) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(subject.name), part],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.at: NDArray[np.float64] | None = None
        self._begin: NDArray[np.float64] | None = None
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(dict(subject.settings)) + "\n")
        self._process.stdin.flush()
        threading.Thread(target=self._listen, daemon=True).start()

    def wait_until_it_moves(self) -> None:
        """Wait until the part moves. Raises RobotError if it does not."""
        deadline = time.monotonic() + START_TIME
        while self.at is None or self._begin is None or float(np.max(np.abs(self.at - self._begin))) < SET_OUT:
            if time.monotonic() > deadline or self._process.poll() is not None:
                raise RobotError("the robot does not move for a program in another process")
            time.sleep(0.005)

    def pid_of(self, process: str) -> int | None:
        """Return the process id of one of ``PROCESSES``, or None if there is none."""
        pid = self._process.pid
        for _ in range(PROCESSES.index(process)):
            below = python_children(pid)
            if not below:
                return None
            pid = below[0]
        return pid

    def close(self) -> None:
        """Kill the remaining processes."""
        left = [pid for process in PROCESSES if (pid := self.pid_of(process)) is not None]
        for pid in left:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._process.communicate()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.at = np.array(json.loads(line)["at"])
            if self._begin is None:
                self._begin = self.at


def python_children(pid: int) -> list[int]:
    """Return the process ids of the Python programs that a process has started; threads and processes may end
    meanwhile.
    """
    children = []
    with suppress(OSError):
        for task in Path(f"/proc/{pid}/task").iterdir():
            with suppress(OSError):
                children += (task / "children").read_text().split()
    return [int(child) for child in children if b"python" in _command_line(child)]


def _command_line(pid: str) -> bytes:
    with suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    return b""


def kill(subject: BroughtUpRobot, part: str, process: str) -> tuple[NDArray[np.float64], list[str]]:
    """Kill ``process`` of a program that moves ``part``. Returns the part's position (n,) at that moment and the names
    of the program's processes.

    Reconnects the robot afterwards.
    """
    with subject.disconnected_robot():
        mover = Mover(subject, part)
        try:
            mover.wait_until_it_moves()
            pids = {name: pid for name in PROCESSES if (pid := mover.pid_of(name)) is not None}
            at = mover.at
            if at is None or process not in pids:
                raise RobotError(f"the {process} of a program that moves the robot has exited unexpectedly")
            os.kill(pids[process], signal.SIGKILL)
            time.sleep(ALONE)
        finally:
            mover.close()
    return at, list(pids)


def killed_processes(subject: BroughtUpRobot) -> Iterator[CheckFinding]:
    """Kill each process of a run in turn while joints move, and yield whether the robot stops."""
    group = next(iter((subject.arms or subject.joint_groups).items()), None)
    if group is None:
        yield not_applicable(subject.model.name, "no joints are behind a connection")
        return
    name, part = group
    start, present = part.positions(), list(PROCESSES)
    for process in PROCESSES:
        if process in present:
            at, present = kill(subject, name, process)
            yield _stands(subject, f"{name}, {process}", part, at)
        else:
            yield not_applicable(f"{name}, {process}", "its controllers need no such process")
    subject.finish(part.move_to(start, SPEED))


def _stands(subject: BroughtUpRobot, what: str, part: JointGroup, at: NDArray[np.float64]) -> CheckFinding:
    here = part.positions()
    subject.robot.clock.sleep(WATCHED)
    drift = float(np.max(np.abs(part.positions() - here)))
    way = float(np.max(np.abs(here - at)))
    longest = REST_TIME * SWING_SPEED + SPARE
    text = (
        f"killed at {SWING_SPEED:g} rad/s: at rest after {way:.3f} rad (at most {longest:.3f}), then moved {drift:.4f}"
    )
    return judged(what, way <= longest and drift <= STILL, text, way_rad=way, drift_rad=drift)


def _dead_man(subject: BroughtUpRobot, name: str, base: MobileBase) -> CheckFinding:
    """Judge the base of a robot whose robot process is killed while it creeps: it receives no stop command."""
    at, _ = kill(subject, name, PROCESSES[1])
    here = base.odometry()
    way = float(np.hypot(here.x - at[0], here.y - at[1]))
    longest = DEAD_MAN * CREEP + BASE_SPARE
    text = f"commands ended at {CREEP:g} m/s: at rest after {1e3 * way:.0f} mm (at most {1e3 * longest:.0f})"
    if way > longest:
        text += ": its controller has no dead-man, set one up (cmd_vel_timeout)"
    return judged(name, way <= longest, text, way_m=way)


dead_man = for_each_part(MobileBase, "no base is", _dead_man)
